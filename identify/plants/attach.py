"""Give a plant effects: their parameters join its own, and its equations stay what they are."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType

from firmloop.identify.error import IdentifyError
from firmloop.identify.plants.effect import Effect, EffectParameter, Site
from firmloop.identify.plants.effects import applies, candidates, find_effect, scales_drive
from firmloop.identify.plants.further_states import with_states
from firmloop.identify.plants.plant import EffectUse, Parameter, Plant
from firmloop.identify.signal import Signal
from firmloop.identify.units import carried_unit, ending_of, unit_of

_EXAMPLES = {  # entries of [plant.balances]
    "torque": 'kind = "torque", per = "1/J_kg_m2", position = "POSITION"',
    "voltage": 'kind = "voltage", per = "1/L_H"',
    "flow": 'kind = "flow", per = "1/A_m2"',
}

__all__ = [
    "EffectUse",
    "acts_at",
    "all_uses",
    "chosen_place",
    "inside_of",
    "label_of",
    "parameters_of",
    "placed",
    "places_of",
    "site_of",
    "told_names",
    "values_of",
    "with_effects",
    "with_position",
]


def site_of(plant: Plant, effect: Effect, output: str | None, at: str | None = None) -> Site:
    """Say where an effect enters; IdentifyError where the plant has no such place."""
    where = f"plant.effects: {effect.name}"
    if not applies(effect, plant):
        raise IdentifyError(f"{where} {_lacking(plant, effect)}")
    outputs = [signal.name for signal in plant.outputs]
    index, balance = 0, _balance(plant, effect, at if at is not None or effect.place != "flow" else output)
    if effect.place in ("sensor",):
        if output is not None and output not in outputs:
            raise IdentifyError(f"{where}.output {output!r} is no output of the plant, which has {', '.join(outputs)}")
        index = outputs.index(output) if output is not None else _first_sensor(plant, effect)
    linear = not any(b.kind == "torque" for b in plant.balances)
    if balance >= 0 and plant.balances[balance].kind in ("torque", "force"):
        linear = plant.balances[balance].kind == "force"
    state = plant.states[plant.balances[balance].state] if balance >= 0 else None
    return Site(
        rotary=not linear,
        effort="N" if linear else "N_m",
        travel="m" if linear else "rad",
        input=ending_of(plant.inputs[0].name),
        input_unit=plant.inputs[0].unit or carried_unit(plant.inputs[0].name),
        output=index,
        output_name=outputs[index],
        output_ending=ending_of(outputs[index]),
        output_unit=plant.outputs[index].unit or carried_unit(outputs[index]),
        level_unit=state.unit if state is not None and effect.place == "flow" else "",
        balance=balance,
        lag=plant.balances[balance].state + 1 if plant.delay is not None and balance >= 0 else 0,
        lag_unit=plant.outputs[0].unit or carried_unit(outputs[0]),
    )


def _lacking(plant: Plant, effect: Effect) -> str:
    """Say what a plant has not that an effect needs; the balances of an `ode` are the project's to name."""
    bodies = [b for b in plant.balances if b.kind in ("torque", "force") and b.state >= 0]
    needs = f"needs {_article(effect.place)} of the plant, and {plant.kind}"
    if plant.kind != "ode":
        return f"{needs} has none; leave it out"
    if bodies and scales_drive(effect):
        state = plant.states[bodies[0].state].name
        key = "effort" if plant.driven < 0 else "current"
        return (
            f'acts on what the drive gives, and no balance says what that is; add {key} = "...", an expression, to '
            f"that of the body which is driven, such as [plant.balances.{state}], or leave the effect out"
        )
    if effect.place not in _EXAMPLES or (effect.place == "torque" and bodies):
        return f"{needs} has none; leave it out"
    return (
        f"{needs} says of no state that its derivative is one; add it to [plant.balances], such as "
        f"STATE = {{ {_EXAMPLES[effect.place]} }}, or leave the effect out"
    )


def _article(place: str) -> str:
    """Return the place with its article, which more than one thing does without."""
    if place.endswith("s"):
        return place
    return f"{'an' if place[0] in 'aeiou' else 'a'} {place}"


def _first_sensor(plant: Plant, effect: Effect) -> int:
    """Return the output an effect acts on where none is named: the first, or for an encoder the first it can be."""
    units = [signal.unit for signal in plant.outputs]
    return next((units.index(unit) for unit in effect.units if unit in units), 0)


def places_of(plant: Plant, effect: Effect) -> tuple[str, ...]:
    """Name the states of the balances that an effect can act on; one that acts on readings or the input has none."""
    return tuple(plant.states[plant.balances[k].state].name for k in _fitting(plant, effect) if _has_state(plant, k))


def _has_state(plant: Plant, balance: int) -> bool:
    return plant.balances[balance].state >= 0


def _fitting(plant: Plant, effect: Effect) -> list[int]:
    wanted = {"torque": ("torque", "force"), "current": ("torque", "force"), "voltage": ("voltage", "winding")}
    kinds = wanted.get(effect.place, (effect.place,))
    fitting = [k for k, b in enumerate(plant.balances) if b.kind in kinds]
    if scales_drive(effect):
        return [k for k in fitting if k == plant.driven]
    return fitting[:1] if any("v->i" in body for _, body in effect.codes) else fitting


def _balance(plant: Plant, effect: Effect, at: str | None) -> int:
    fitting = _fitting(plant, effect)
    if at is None:
        return fitting[0] if fitting else -1
    for k in fitting:
        if _has_state(plant, k) and plant.states[plant.balances[k].state].name == at:
            return k
    places = ", ".join(places_of(plant, effect)) or "none: it acts on readings or on the input, so remove the key"
    raise IdentifyError(f"plant.effects: {effect.name}.at {at!r} is no state it can act at; those are {places}")


def inside_of(plant: Plant, site: Site) -> tuple[int, ...]:
    """Return the arguments of the plant's inside that an effect sets there; none where it acts from outside."""
    return plant.balances[site.balance].inside if site.balance >= 0 else ()


def label_of(plant: Plant, use: EffectUse) -> str:
    """Return what the parameters of a use are called after: `coulomb_friction`, `sensor_offset.current_A`."""
    effect = find_effect(use.name)
    site = site_of(plant, effect, use.output, use.at)
    if effect.place == "sensor":
        return f"{use.name}.{site.output_name}"
    if effect.place == "flow" or (use.at is not None and site.balance != _balance(plant, effect, None)):
        return f"{use.name}.{plant.states[plant.balances[site.balance].state].name}"
    return use.name


def parameters_of(
    plant: Plant, name: str, output: str | None = None, at: str | None = None
) -> tuple[EffectParameter, ...]:
    """Return the parameters an effect has on this plant."""
    effect = find_effect(name)
    return effect.parameters(site_of(plant, effect, output, at))


def with_effects(plant: Plant, uses: Sequence[EffectUse]) -> Plant:
    """Return the plant with these effects instead of those it had; IdentifyError where one does not fit."""
    effects = [find_effect(use.name) for use in uses]
    for effect, use in zip(effects, uses, strict=True):
        if effect.needs_position:
            plant = with_position(plant, _balance(plant, effect, use.at))
    nominal = plant.parameters[: plant.rate.numel_in(2)]
    resolved: list[EffectUse] = []
    parameters, seen = list(nominal), set()
    for effect, use in sorted(zip(effects, uses, strict=True), key=_order):
        label = label_of(plant, use)
        if label in seen:
            raise IdentifyError(f"plant.effects: {label} stands twice; an effect can be there once")
        seen.add(label)
        if effect.remembers and any(effect.name == other.name for other in resolved):
            raise IdentifyError(f"plant.effects: {effect.name} acts at two bodies; the simulator remembers one of them")
        resolved.append(use)
        parameters.extend(_parameters(plant, effect, use, label))
    return replace(plant, parameters=tuple(parameters), effects=tuple(resolved))


def _order(pair: tuple[Effect, EffectUse]) -> tuple[int, str, str, str]:
    """Order effects by what they are, never by the lines of a project."""
    effect, use = pair
    return effect.stage, effect.name, use.output or "", use.at or ""


def _parameters(plant: Plant, effect: Effect, use: EffectUse, label: str) -> list[Parameter]:
    where = f"plant.effects: {effect.name}"
    known = effect.parameters(site_of(plant, effect, use.output, use.at))
    names = [p.name for p in known]
    for name in (*use.values, *use.free):
        if name not in names:
            raise IdentifyError(f"{where}.{name} is unknown; it has {', '.join(names) or 'no parameters'}")
    made = []
    for p in known:
        value = use.values.get(p.name, p.default)
        if value is None:
            raise IdentifyError(f"{where}.{p.name} is missing; write {p.name} = ... (in {p.unit or 'no unit'})")
        if not (p.low <= value <= p.high or value == p.neutral) or math.isnan(value):
            raise IdentifyError(f"{where}.{p.name} is {value:g} {p.unit}; it must lie within {p.low:g} and {p.high:g}")
        made.append(
            Parameter(f"{label}.{p.name}", p.unit, value, p.name in use.free, p.low, p.high, None, p.logarithmic)
        )
    return made


def placed(plant: Plant) -> tuple[tuple[Effect, Site, tuple[int, ...]], ...]:
    """List the effects of the plant, where each enters, and which of the plant's constants are its own."""
    at, result = plant.rate.numel_in(2), []
    for use in plant.effects:
        effect = find_effect(use.name)
        site = site_of(plant, effect, use.output, use.at)
        known = effect.parameters(site)
        result.append((effect, site, tuple(range(at, at + len(known)))))
        at += len(known)
    return tuple(result)


def all_uses(plant: Plant) -> tuple[EffectUse, ...]:
    """Every candidate at its neutral value; on every output, level or body that it can act on.

    What the simulator remembers for one body acts on the first.
    """
    uses = []
    for effect in candidates(plant):
        places: Sequence[tuple[str | None, str | None]] = ((None, None),)
        if effect.place == "sensor":
            places = [(s.name, None) for s in plant.outputs if not effect.units or s.unit in effect.units]
        elif effect.place == "flow":
            places = [(plant.states[b.state].name, None) for b in plant.balances if b.kind == "flow"]
        elif effect.place == "torque" and not effect.remembers:
            places = [*places, *((None, at) for at in places_of(plant, effect)[1:])]
        for output, at in places:
            known = effect.parameters(site_of(plant, effect, output, at))
            values = MappingProxyType({p.name: p.neutral for p in known})
            uses.append(EffectUse(effect.name, output, values, at=at))
    return tuple(uses)


def chosen_place(plant: Plant, use: EffectUse) -> str | None:
    """Name the place of an effect that has to say it: a plant written as text has several balances for it.

    None where the effect acts on readings or the input, or can act at one place only.
    """
    choice = plant.kind == "ode" and use.output is None and len(places_of(plant, find_effect(use.name))) > 1
    return acts_at(plant, use) if choice else None


def told_names(plant: Plant) -> Mapping[str, str]:
    """Return how each parameter is told, by its name: with the place wherever there is a choice of it.

    The name itself leaves out the first place.
    """
    told = {p.name: p.name for p in plant.parameters}
    for use in plant.effects if any("." in name for name in told) else ():  # an effect's have a label and a dot
        label, place = label_of(plant, use), chosen_place(plant, use)
        if place is not None and label == use.name:
            own = (p.name for p in parameters_of(plant, use.name, use.output, use.at))
            told |= {f"{label}.{name}": f"{label}.{place}.{name}" for name in own}
    return told


def acts_at(plant: Plant, use: EffectUse) -> str:
    """Name what an effect acts on: the output it is read on, the state of its balance, or else the input."""
    effect = find_effect(use.name)
    site = site_of(plant, effect, use.output, use.at)
    if effect.place == "sensor":
        return site.output_name
    if site.balance >= 0 and _has_state(plant, site.balance):
        return plant.states[plant.balances[site.balance].state].name
    return plant.inputs[0].name


def with_position(plant: Plant, balance: int | None = None) -> Plant:
    """Add the integral of the speed as the last state where the plant does not have it.

    It is that of the body whose `balance` it is; of the first body where that is no body's, a sensor's or a winding's.
    """
    bodies = [k for k, b in enumerate(plant.balances) if b.kind in ("torque", "force")]
    first = bodies[0] if bodies else -1
    index = balance if balance is not None and balance in bodies else first
    if index < 0 or plant.balances[index].position >= 0:
        return plant
    speed = plant.states[plant.balances[index].state]
    unit = "rad" if plant.balances[index].kind == "torque" else "m"
    name = speed.name.replace("speed", "position").removesuffix("_s") if "speed" in speed.name else f"position_{unit}"
    if index != first:
        name = f"{speed.name}_integral"  # no column is called so
    place = Signal(name, unit_of(name) or unit, -math.inf, math.inf)
    made = with_states(plant, [place], lambda x: x[plant.balances[index].state])
    balances = [replace(b, position=len(plant.states)) if k == index else b for k, b in enumerate(made.balances)]
    return replace(made, balances=tuple(balances))


def values_of(plant: Plant, use: EffectUse) -> Mapping[str, float]:
    """Return the values which the plant's parameters now hold for one of its effects."""
    label = label_of(plant, use)
    known = parameters_of(plant, use.name, use.output, use.at)
    held = {p.name: p.value for p in plant.parameters}
    return {p.name: held[f"{label}.{p.name}"] for p in known}

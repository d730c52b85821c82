"""Build a plant from the `[plant]` table of a project: its kind, its parameters, its effects."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType

from firmloop.identify.error import IdentifyError
from firmloop.identify.plants.attach import chosen_place, label_of, parameters_of, places_of, site_of, with_effects
from firmloop.identify.plants.effects import find_effect
from firmloop.identify.plants.kinds import deviation_of, make_plant
from firmloop.identify.plants.ode import make_ode
from firmloop.identify.plants.plant import EffectUse, Parameter, Plant

_ENTRY_KEYS = ("value", "free", "ci95")


def plant_from_table(table: Mapping[str, object]) -> Plant:
    """Build the plant; IdentifyError begins with the key that is wrong."""
    if table.get("kind") == "ode":
        plant = make_ode(table)
    else:
        outputs, parameters = table.get("outputs", ()), table.get("parameters", {})
        inputs = table.get("inputs", table.get("input"))
        assert isinstance(inputs, Sequence) and isinstance(outputs, Sequence) and isinstance(parameters, Mapping)
        per_unit = {key: value for key, value in table.items() if key in ("force_per_unit", "torque_per_unit")}
        fixed = {key: {"value": value, "free": False} for key, value in per_unit.items()}
        plant = make_plant(str(table["kind"]), inputs, list(outputs), {**fixed, **parameters})
    entries = table.get("effects", ())
    assert isinstance(entries, Sequence)
    if not entries:
        return plant
    uses, deviations = [], {}
    for entry in entries:
        use, found = _use(entry)
        _check_place(plant, use)
        use = _with_reading(plant, use)
        uses.append(use)
        label = label_of(plant, use)
        deviations.update({f"{label}.{name}": deviation for name, deviation in found.items()})
    made = with_effects(plant, uses)
    known = [replace(p, deviation=deviations.get(p.name, p.deviation)) for p in made.parameters]
    return replace(made, parameters=tuple(known))


def effects_table(plant: Plant) -> list[dict[str, object]]:
    """Return the `[[plant.effects]]` entries that make the plant's effects again, with the values they have now."""
    held = {parameter.name: parameter for parameter in plant.parameters}
    entries = []
    for use in plant.effects:
        entry: dict[str, object] = {"name": use.name}
        if use.output is not None or (find_effect(use.name).place == "sensor" and len(plant.outputs) > 1):
            entry["output"] = use.output or site_of(plant, find_effect(use.name), None).output_name
        places = places_of(plant, find_effect(use.name))
        if use.at is not None or chosen_place(plant, use) is not None:
            entry["at"] = use.at if use.at is not None else places[0]
        label = label_of(plant, use)
        for known in parameters_of(plant, use.name, use.output, use.at):
            parameter = held[f"{label}.{known.name}"]
            entry[known.name] = _entry(parameter)
        entries.append(entry)
    return entries


def _entry(parameter: Parameter) -> object:
    if not parameter.free and parameter.deviation is None:
        return parameter.value
    entry: dict[str, object] = {"value": parameter.value, "free": parameter.free}
    if parameter.interval_95 is not None:
        entry["ci95"] = [float(f"{end:.6g}") for end in parameter.interval_95]
    return entry


def _check_place(plant: Plant, use: EffectUse) -> None:
    """Refuse a place that is not used, and one that is not said where there is a choice."""
    effect = find_effect(use.name)
    where = f"plant.effects: {use.name}"
    if use.output is not None and effect.place not in ("sensor", "flow"):
        at = " or ".join(places_of(plant, effect)) if use.at is None else ""
        way = f"say where it acts with at = {at}" if at else "remove the key"
        raise IdentifyError(f"{where}.output {use.output!r} is not used: it acts on no reading; {way}")
    if use.output is not None and use.at is not None:
        raise IdentifyError(f"{where} has output and at; it needs one of them")
    if use.at is None and chosen_place(plant, use) is not None:
        places = places_of(plant, effect)
        raise IdentifyError(
            f'{where}.at is missing: it can act at {", ".join(places)}; write at = "{places[0]}", for instance'
        )


def _with_reading(plant: Plant, use: EffectUse) -> EffectUse:
    """Return the use with the one reading that it can be of; refuse one that does not say which of several."""
    effect = find_effect(use.name)
    if use.output is not None or use.at is not None or effect.place != "sensor" or len(plant.outputs) == 1:
        return use
    names = [
        output.name
        for output in plant.outputs
        if not effect.units or output.unit in effect.units
        if use.values.keys() <= {known.name for known in parameters_of(plant, use.name, output.name)}
    ]
    if len(names) > 1:
        raise IdentifyError(
            f"plant.effects: {use.name}.output is missing: it can act on {', '.join(names)}; write "
            f'output = "{names[0]}", for instance'
        )
    return replace(use, output=names[0]) if names else use


def _use(entry: object) -> tuple[EffectUse, Mapping[str, float | None]]:
    if not isinstance(entry, Mapping) or not isinstance(entry.get("name"), str):
        raise IdentifyError('plant.effects: an entry needs a name, such as name = "coulomb_friction"')
    name, output, at = str(entry["name"]), entry.get("output"), entry.get("at")
    if at is not None and not isinstance(at, str):
        raise IdentifyError(f"plant.effects: {name}.at is {at!r}; it must be the state of a balance")
    if output is not None and not isinstance(output, str):
        raise IdentifyError(f"plant.effects: {name}.output is {output!r}; it must be the name of an output")
    values: dict[str, float] = {}
    free: list[str] = []
    deviations: dict[str, float | None] = {}
    for key, given in entry.items():
        if key in ("name", "output", "at"):
            continue
        where = f"plant.effects: {name}.{key}"
        inner = given if isinstance(given, Mapping) else {"value": given, "free": False}
        for word in inner:
            if word not in _ENTRY_KEYS:
                raise IdentifyError(f"{where}.{word} is unknown; a parameter has {', '.join(_ENTRY_KEYS)}")
        value, movable = inner.get("value"), inner.get("free", True)
        if isinstance(value, bool) or not isinstance(value, int | float) or math.isnan(value):
            others = "" if value is not None and not isinstance(value, str) else "; other keys are name, output and at"
            raise IdentifyError(f"{where} is {value!r}; it must be a number or {{ value = ..., free = true }}{others}")
        if not isinstance(movable, bool):
            raise IdentifyError(f"{where}.free is {movable!r}; it is true (the fit may change it) or false")
        values[key] = float(value)
        free.extend([key] if movable else [])
        deviations[key] = deviation_of(where, inner.get("ci95"))
    return EffectUse(name, output, MappingProxyType(values), tuple(free), at), deviations

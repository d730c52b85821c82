"""The library of effects: physics beyond the nominal equations; every file of this folder that has an EFFECT is one.

How to use it (all values SI; a parameter of an effect is called `<effect>.<parameter>`, for sensor effects
`<effect>.<output>.<parameter>`, for instance `coulomb_friction.torque_N_m`, `sensor_offset.current_A.offset_A`):

    from firmloop.identify.plants.effects import candidates, effects, find_effect
    from firmloop.identify.plants.plant import EffectUse
    from firmloop.identify.plants.attach import with_effects, parameters_of, label_of
    from firmloop.identify.simulation.superset import superset, starts_of

    candidates(plant) -> tuple[Effect, ...]                    every effect this plant can have
    EffectUse(name, output: str | None, values: Mapping[str, float], free: tuple[str, ...])
                                                               output None: the first one; a flow effect names its state
    with_effects(plant, uses) -> Plant                         a Plant like any other: simulate, fit, linearize take it
    parameters_of(plant, name, output) -> tuple[EffectParameter, ...]
    starts_of(plant, recordings, name, output) -> tuple[dict[str, float], ...]      starting grid, full parameter names
    superset(plant) -> Superset                                all candidates (sensor effects on every output), neutral
        .names                 all parameter names, nominal ones first
        .neutral               Mapping name -> value that changes nothing (nominal ones: the plant's values)
        .states                names of the start state (the plant's, and the position where it had none)
        .simulate(recording, parameters, start) -> (n, r)      `parameters`: those that differ from .neutral; start
                                                               None: at rest, at the first recorded position; NaN
                                                               after a divergence
        .slopes(recording, parameters, names, start) -> (n, r, k)     d output / d parameter, one-sided at a bound;
                                                               names may hold `start.<state>` too
    from firmloop.identify.plants.plant_table import effects_table, plant_from_table
    effects_table(plant) -> the [[plant.effects]] entries, with the values and intervals the parameters now have

A slope at an infinite neutral value (limits, saturations) is NaN: begin at one of `starts_of`.
Nothing is compiled after the first simulation of the first plant (`ode` plants: once per set of equations).
"""

from __future__ import annotations

import difflib
import importlib
import pkgutil
from collections.abc import Mapping
from functools import cache

from firmloop.identify.error import IdentifyError
from firmloop.identify.plants.effect import Effect
from firmloop.identify.plants.plant import Plant

_PROPORTIONAL = ("torque", "force", "voltage")  # balances whose current is the drive's torque but for a constant


@cache
def effects() -> Mapping[str, Effect]:
    """Every effect below this folder, by name and in the order of names."""
    found = pkgutil.walk_packages(__path__, f"{__name__}.")
    modules = [importlib.import_module(module.name) for module in found if not module.ispkg]
    named = {module.EFFECT.name: module.EFFECT for module in modules}
    return {name: named[name] for name in sorted(named)}


def find_effect(name: str) -> Effect:
    """Return the effect called `name`; IdentifyError says which ones are called alike."""
    if name not in effects():
        near = difflib.get_close_matches(name, sorted(effects()), n=3, cutoff=0.4)
        hint = f"did you mean {' or '.join(near)}?" if near else "one is called coulomb_friction, for instance"
        raise IdentifyError(f"plant.effects: {name[:60]!r} is none of the {len(effects())} effects; {hint}")
    return effects()[name]


_WAVES = ("turn", "order", "order of effort")  # `Effect.seen_by` of what comes again along an angle or a way


def applies(effect: Effect, plant: Plant) -> bool:
    """Tell whether the plant has the place where the effect enters."""
    kinds = {balance.kind for balance in plant.balances}
    if effect.rotary_only and "torque" not in kinds:
        return False
    waves = effect.rotary_only or effect.seen_by in _WAVES
    if waves and plant.delay is not None and plant.outputs[0].unit.split("/")[0] not in ("rad", "m"):
        return False  # a lag in volts may be a place, but not one that tells how far a turn goes
    if scales_drive(effect) and plant.driven < 0:
        return False
    if effect.fits is not None:
        return effect.fits(plant)
    if effect.place in ("sensor", "actuator", "timing"):
        return True
    if effect.place == "torque":
        return bool(kinds & {"torque", "force"})
    if effect.place == "current":
        return any(b.current is not None and b.kind in _PROPORTIONAL for b in plant.balances if not b.inside)
    return effect.place in kinds


def scales_drive(effect: Effect) -> bool:
    """Tell whether an effect is a share of what the drive gives, so that it acts on the driven body alone."""
    return any("v->effort" in body for _, body in effect.codes)


def candidates(plant: Plant) -> tuple[Effect, ...]:
    """Every effect that this plant can have."""
    return tuple(effect for effect in effects().values() if applies(effect, plant))


def effect_seen_by(means: str) -> Effect:
    """Return the one effect that `means` finds before any fit (`Effect.seen_by`)."""
    (found,) = (effect for effect in effects().values() if effect.seen_by == means)
    return found

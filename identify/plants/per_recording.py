"""Let values of a plant differ from recording to recording: a load, the zero or the gain of a sensor, a parameter."""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from firmloop.identify.error import IdentifyError
from firmloop.identify.plants.attach import label_of, parameters_of, places_of, told_names, values_of, with_effects
from firmloop.identify.plants.effects import candidates, find_effect
from firmloop.identify.plants.further_states import with_states, without_states
from firmloop.identify.plants.operating_point import OUTPUT
from firmloop.identify.plants.plant import EffectUse, Plant, Varying
from firmloop.identify.signal import Signal

Array = NDArray[np.float64]

_KEY = "recordings.per_recording"


@dataclass(frozen=True, slots=True)
class _Listed:
    """What a name stands for: a parameter by its full name, and the effect that it belongs to where it has to join."""

    parameter: str
    use: EffectUse | None = None


def with_varying(plant: Plant, names: Sequence[str]) -> Plant:
    """Return the plant in which these values are each recording's own; IdentifyError where it has no such value.

    What they are for all recordings, the plant keeps: a load and a zero of 0, a gain of 1, where it does not have them.
    """
    if not names:
        return plant
    known = _can_be_listed(plant)
    known = {**known, **{told: known[name] for name, told in told_names(plant).items() if told != name}}
    for name in names:
        if name not in known:
            near = difflib.get_close_matches(name, known, n=1)
            hint = f"; did you mean {near[0]!r}?" if near else ""
            raise IdentifyError(
                f"{_KEY} names {name!r}, which {plant.kind} does not have{hint}; what can differ from file to file is "
                f"{', '.join(known)}"
            )
    chosen = {known[name].parameter: name for name in names}
    if len(chosen) < len(names):
        raise IdentifyError(f"{_KEY} names {', '.join(names)}: two of them are the same value; name it once")
    given = {p.name: p for p in plant.parameters}
    joined = [known[name].use for name in names]
    uses = [replace(use, values=values_of(plant, use)) for use in plant.effects]
    made = with_effects(plant, [*uses, *(use for use in joined if use is not None)])
    parameters = [given.get(p.name, p) for p in made.parameters]
    listed = {p.name: p for p in parameters if p.name in chosen}
    varying = tuple(
        Varying(
            name, full, len(made.states) + k, listed[full].low >= 0.0 and listed[full].value != 0.0, listed[full].free
        )
        for k, (full, name) in enumerate(chosen.items())
    )
    states = [Signal(one.name, listed[one.parameter].unit, -math.inf, math.inf) for one in varying]
    wider = with_states(made, states, lambda _: ca.SX.zeros(len(states)))
    held = tuple(replace(p, free=p.free and p.name not in chosen) for p in parameters)
    return replace(wider, parameters=held, varying=varying)


def without_varying(plant: Plant) -> Plant:
    """Return the plant as it is for all recordings, with the effects and the values it has."""
    if not plant.varying:
        return plant
    free = {one.parameter: one.free for one in plant.varying}
    parameters = tuple(replace(p, free=free.get(p.name, p.free)) for p in plant.parameters)
    bare = without_states(plant, [one.state for one in plant.varying])
    return replace(bare, parameters=parameters, varying=())


def in_common(plant: Plant, names: Sequence[str]) -> Plant:
    """Return the plant whose parameters of these full names all recordings share after all, to be fitted."""
    varying = tuple(one for one in plant.varying if one.parameter not in names)
    return replace(plant.freed(*names), varying=varying)


def without_value(plant: Plant) -> tuple[str, ...]:
    """Return the full names of what differs between recordings and has no value yet."""
    own = {one.parameter for one in plant.varying}
    return tuple(p.name for p in plant.parameters if p.name in own and math.isnan(p.value))


def centred(plant: Plant, constants: Array, starts: Array) -> tuple[Array, Array]:
    """Make what all recordings have the mean of what each has; `starts` (w, n) are their initial states."""
    constants, starts = constants.copy(), starts.copy()
    names = [p.name for p in plant.parameters]
    for one in plant.varying:
        index, mean = names.index(one.parameter), float(np.mean(starts[:, one.state]))
        constants[index] = one.at(float(constants[index]), mean)
        starts[:, one.state] -= mean
    return constants, starts


def named_effects(plant: Plant) -> frozenset[str]:
    """Return the labels of the effects one of whose values differs from recording to recording."""
    return frozenset(one.parameter.rpartition(".")[0] for one in plant.varying) - {""}


def ways_to_differ(plant: Plant) -> tuple[tuple[str, ...], ...]:
    """Return what most often differs between runs of one machine, by the names of a project: each, then each kind.

    Of a plant with a level of rest that is the zero of its sensor.
    """
    known = _can_be_listed(plant)
    named = [name for name, listed in known.items() if name != listed.parameter]
    if OUTPUT in known:
        named = [OUTPUT if _word(name) == find_effect("sensor_offset").per_recording else name for name in named]
    kinds = [tuple(name for name in named if _word(name) == word) for word in dict.fromkeys(map(_word, named))]
    return (*((name,) for name in named), *(kind for kind in kinds if len(kind) > 1))


def _word(name: str) -> str:
    return re.split("[._]", name)[0]


def _can_be_listed(plant: Plant) -> Mapping[str, _Listed]:
    """Return what may differ from file to file, by the name in a project."""
    found = {}
    declared = {p.name for p in plant.parameters}

    def add(word: str, use: EffectUse) -> None:
        known = parameters_of(plant, use.name, use.output, use.at)[0]
        full = f"{label_of(plant, use)}.{known.name}"
        joins = replace(use, values={known.name: known.neutral})
        found[word] = _Listed(full, None if full in declared else joins)

    for effect in candidates(plant):
        word = effect.per_recording
        if word and effect.place == "sensor":
            for signal in plant.outputs:
                add(f"{word}.{signal.name}", EffectUse(effect.name, signal.name))
        elif word:
            for k, place in enumerate(places_of(plant, effect)):
                size = parameters_of(plant, effect.name, None, place)[0].name
                add(
                    f"{word}_{size}" if k == 0 else f"{word}_{size}.{place}",
                    EffectUse(effect.name, at=place if k else None),
                )
    return found | {p.name: _Listed(p.name) for p in plant.parameters}

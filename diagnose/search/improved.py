"""Write an explanation into the plant: its effects, its nominal parameters, and how well each is known."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from firmloop.diagnose.data.quantization import Direct, coarse
from firmloop.diagnose.model.candidate import Candidate, residual_sizes
from firmloop.diagnose.model.fit import deviations
from firmloop.diagnose.model.hypothesis import as_written, declared
from firmloop.diagnose.search.found import Search
from firmloop.identify.plants.attach import label_of, parameters_of, with_effects
from firmloop.identify.plants.per_recording import centred
from firmloop.identify.plants.plant import EffectUse, Parameter, Plant


def directs(search: Search) -> tuple[Direct, ...]:
    """Return what is read off the recordings, before and after the search."""
    problem = search.problem
    return (*problem.direct, *coarse(problem.plant, problem.train, residual_sizes(search.best.fitted.residuals)))


def blurred(search: Search, shown: Candidate, read: Sequence[Direct]) -> tuple[Direct, ...]:
    """Return the steps among what was read off that noise blurs: their average is nearer to a reading than they are."""
    found = []
    for each in read:
        index = next(k for k, signal in enumerate(search.problem.plant.outputs) if signal.name == each.output)
        if each.in_steps:
            left = [part[:, index] for part in shown.fitted.residuals]
            stepped = [each.values[0] * np.round(part / each.values[0]) for part in left]
            if any(np.std(one) > np.std(other) for one, other in zip(stepped, left, strict=True)):
                found.append(each)
    return tuple(found)


def improved_plant(search: Search, shown: Candidate) -> Plant:
    """Return the plant with the parameters and effects of an explanation, beside those it had."""
    values, spread = as_written(shown.fitted.point.values), deviations(shown.fitted)
    bare = tuple(_improved(p, values, spread) for p in search.problem.plant.parameters)
    given = replace(search.problem.plant, parameters=bare)
    given = _centred(given, shown)
    uses = declared(given, shown.fitted.terms)
    uses += [term.use(values) for term in shown.fitted.terms]
    known_spread = dict(spread)
    read = directs(search)
    hidden = blurred(search, shown, read)
    for each in (one for one in read if one not in hidden):
        known = parameters_of(search.problem.plant, each.effect, each.output)
        values_read = {parameter.name: value for parameter, value in zip(known, each.values, strict=True)}
        uses.append(EffectUse(each.effect, each.output, values_read))
        label = label_of(search.problem.plant, uses[-1])
        known_spread |= {f"{label}.{k.name}": size for k, size in zip(known, each.deviations, strict=True)}
    if not uses:
        return given
    made = with_effects(given, uses)
    count = given.rate.numel_in(2)
    own = [replace(p, deviation=_finite(known_spread.get(p.name, math.nan))) for p in made.parameters[count:]]
    return replace(made, parameters=(*made.parameters[:count], *own))


def _centred(plant: Plant, shown: Candidate) -> Plant:
    """Return the plant with the mean of what its recordings have each of their own."""
    starts = np.stack([start[: len(plant.states)] for start in shown.fitted.point.starts])
    values = shown.fitted.point.values
    constants, _ = centred(plant, np.array([values.get(p.name, p.value) for p in plant.parameters]), starts)
    own = [replace(p, value=float(value)) for p, value in zip(plant.parameters, constants, strict=True)]
    return replace(plant, parameters=tuple(own))


def _improved(parameter: Parameter, values: Mapping[str, float], spread: Mapping[str, float]) -> Parameter:
    if not parameter.free:
        return parameter
    return replace(
        parameter,
        value=float(values.get(parameter.name, parameter.value)),
        deviation=_finite(spread.get(parameter.name, math.nan)),
    )


def _finite(deviation: float) -> float | None:
    return float(deviation) if math.isfinite(deviation) else None

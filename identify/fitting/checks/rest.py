"""An output that rests elsewhere than where the plant does: ambient temperature, an offset of the sensor."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import cache, partial
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from firmloop.identify.error import IdentifyError
from firmloop.identify.fitting.check import Check
from firmloop.identify.fitting.evidence import Evidence, Remainder, explained, remainders
from firmloop.identify.fitting.experiment import experiments
from firmloop.identify.fitting.fit import Fit, about_means, estimate, judge, tried
from firmloop.identify.fitting.residual_tests import independent, likelier, residual_tests
from firmloop.identify.fitting.sufficiency import outlasting
from firmloop.identify.plants.attach import EffectUse, values_of, with_effects
from firmloop.identify.plants.kinds import kinds
from firmloop.identify.plants.operating_point import OUTPUT
from firmloop.identify.plants.per_recording import with_varying
from firmloop.identify.plants.plant import Parameter, Plant
from firmloop.identify.recordings.stillness import driven, resting
from firmloop.identify.signal import Signal
from firmloop.identify.simulation.simulate import driven_by, rest_start, simulate
from firmloop.identify.units import ending_of

Array = NDArray[np.float64]
_Means = Callable[[], Plant | None]  # `about_means`, asked once

_HINT = 6.0  # independent samples times the share explained, from which a fit with the level is worth its time
_SHARE = 0.2  # of what is left, that a level explains along the slopes: worth it, too
_CERTAIN = 16.0  # by which twice the log likelihood rises; 1 in 16,000 by chance
_SEVERAL = 2  # recordings, which may differ
_SEEN = 0.01  # of the output's range: a level below it harms nobody
_APART = 0.1  # of the largest input: recordings whose first inputs differ by more begin under different ones


def look(evidence: Evidence) -> tuple[str, ...]:
    """Ask each output whether a constant level explains what is left, and fit it where it may."""
    assert evidence.fit is not None
    parts = remainders(evidence)
    plant = evidence.fit.plant
    weights = np.array([1.0 / max(evidence.fit.noise[o.name], 1e-300) for o in plant.outputs])
    found, refused = [], _refused(evidence)
    means = cache(partial(about_means, evidence.given, evidence.recordings, evidence.conditioning))
    drives = [driven_by(evidence.given, recording) for recording in evidence.recordings]
    most = np.max(np.abs(np.concatenate(drives)), axis=0)
    for k in range(len(plant.outputs)):
        columns = [np.zeros_like(part.residual) for part in parts]
        reading, seen = _undriven(evidence, drives, most, k), _SEEN * _spread(evidence, plant.outputs[k].name)
        resting_at_zero = reading is not None and abs(reading) < seen
        for column in columns:
            column[:, k] = 1.0
        if resting_at_zero and [len(column) for column in columns] == [len(drive) for drive in drives]:
            for column, drive in zip(columns, drives, strict=True):
                column[~driven(drive, most)] = 0.0
        hint = explained(parts, weights, columns)
        samples = independent([part.residual[:, k] for part in parts])
        if hint.share * samples < _HINT and hint.share < _SHARE and not refused and not _astray(evidence, parts, k):
            continue
        if reading is not None and resting_at_zero:  # it rests where the plant does, whatever a fit makes of it
            if -samples * math.log1p(-min(hint.share, 1.0 - 1e-12)) > _CERTAIN and abs(hint.size) > seen:
                found.append(_in_motion(plant, k, hint.size, reading))
            continue
        said = _apart(evidence, k, means) or _fitted(evidence, k, hint.size, means)
        found += [said] if said else []
    return tuple(found)


def _undriven(evidence: Evidence, drives: Sequence[Array], most: Array, k: int) -> float | None:
    """Return what an output reads where recordings begin at rest; None where none is known to.

    They do with no input yet, or where they begin alike whatever the input then is: no two inputs hold a plant there.
    """
    plant = evidence.given
    readings = [recording.columns[plant.outputs[k].name][:, None] for recording in evidence.recordings]
    rest = np.concatenate([resting(*each, most) for each in zip(readings, drives, strict=True)])
    if len(rest):
        return float(np.mean(rest))
    firsts = np.array([each[0] for each in readings])
    apart = np.ptp([drive[0] for drive in drives], axis=0) > _APART * most
    alike = float(np.ptp(firsts)) < _SEEN * _spread(evidence, plant.outputs[k].name)
    return float(np.mean(firsts)) if np.any(apart & (most > 0.0)) and alike else None


def _in_motion(plant: Plant, k: int, level: float, reading: float) -> str:
    """Say that what looks like a level is there only while the plant moves."""
    output = plant.outputs[k]
    unit = f" {output.unit}".rstrip()
    lacks = "dry friction, a dead zone, a load" if plant.moves else "a dead zone, a constant drop"
    return (
        f"{output.name} is met better by {level:.4g}{unit} more than the plant gives, but reads {reading:.4g}{unit} "
        f"before anything drives it: no level at rest, but {lacks}, a lag or a delay that the plant lacks, or an "
        "answer that is no straight line; `firmloop diagnose` says which"
    )


def _spread(evidence: Evidence, output: str) -> float:
    """Return the widest range of an output in one recording."""
    return max(float(np.ptp(recording.columns[output])) for recording in evidence.recordings)


def _fitted(evidence: Evidence, k: int, level: float, means: _Means) -> str:
    """Fit the level together with everything else; say so where that is better beyond doubt."""
    before = evidence.fit
    assert before is not None
    output = before.plant.outputs[k]
    in_kind = _in_kind(before.plant, output)
    if in_kind and OUTPUT in {parameter.name for parameter in before.plant.parameters}:
        return ""
    if any(use.name == "sensor_offset" and use.output in (output.name, None) for use in before.plant.effects):
        return ""
    ending = ending_of(output.name)
    name = OUTPUT if in_kind else f"sensor_offset.{output.name}.offset{f'_{ending}' if ending else ''}"
    after = _best_with(evidence, output, name, in_kind, level, means)
    if after is None:
        return ""
    found = next(p for p in after.plant.parameters if p.name == name)
    spread = _spread(evidence, output.name)
    half = 0.0 if found.interval_95 is None else found.interval_95[1] - found.value
    if _gain(evidence, before, after) < _CERTAIN or abs(found.value) < max(_SEEN * spread, half):
        return ""
    value, unit = f"{found.value:.4g}", f" {output.unit}".rstrip()
    if in_kind:
        return (
            f"{output.name} rests at {value}{unit} and {before.plant.kind} at 0: write {OUTPUT} = {{ value = {value}, "
            "free = true } in [plant.parameters] (and input_at_rest, if the input does not rest at 0)"
        )
    others = "a constant load or friction" if before.plant.moves else "something constant that the equations lack"
    reads = f"{abs(found.value):.4g}{unit} {'more' if found.value > 0.0 else 'less'}"
    return (
        f"{output.name} reads {reads} than the plant gives, all the time: an offset of the sensor, or {others}; "
        f'for an offset write [[plant.effects]] with name = "sensor_offset", output = '
        f'"{output.name}" and {name.rpartition(".")[2]} = {{ value = {value}, free = true }}'
    )


def _apart(evidence: Evidence, k: int, means: _Means) -> str:
    """Fit a level of each recording where there are several; say so where one for all is worse beyond doubt."""
    before, count = evidence.fit, len(evidence.recordings)
    assert before is not None
    output = before.plant.outputs[k]
    if count < _SEVERAL or before.plant.varying or not _in_kind(before.plant, output):
        return ""
    centred = means()
    if centred is None:
        return ""
    held = {parameter.name for parameter in centred.parameters}
    begin = with_varying(centred if OUTPUT in held else _with_level(centred, output.unit), (OUTPUT,))
    after = tried(begin, evidence.recordings, evidence.conditioning)
    if after is None:
        return ""
    levels = {own.source: own.parameter.value for own in after.per_recording}
    spread = _spread(evidence, output.name)
    differs = max(levels.values()) - min(levels.values())
    if _gain(evidence, before, after) < count * _CERTAIN or differs < _SEEN * spread:
        return ""
    together = before if OUTPUT in held else _best_with(evidence, output, OUTPUT, True, 0.0, means) or before
    if _gain(evidence, together, after) < count * _CERTAIN:
        return ""
    each = ", ".join(f"{value:.4g} in {source}" for source, value in levels.items())
    mean = float(np.mean([*levels.values()]))
    return (
        f"{output.name} rests at another level in each recording, {output.unit or '1'}: {each}: write {OUTPUT} = "
        f"{{ value = {mean:.4g}, free = true }} in [plant.parameters] and per_recording = "
        f'["{OUTPUT}"] in [recordings]'
    )


def _astray(evidence: Evidence, parts: Sequence[Remainder], k: int) -> bool:
    """Tell whether what is left of an output that may have a level of its own is no white noise."""
    assert evidence.fit is not None
    plant = evidence.fit.plant
    if not _in_kind(plant, plant.outputs[k]):
        return False
    drives = [recording.columns[plant.inputs[0].name] for recording in evidence.recordings]
    return any(
        not residual_tests(part.residual[:, k], drive).white
        for part, drive in zip(parts, drives, strict=True)
        if len(part.residual) == len(drive)
    )


def _in_kind(plant: Plant, output: Signal) -> bool:
    """Tell whether the level of an output is a parameter that its kind may have."""
    own = kinds()[plant.kind].optional if plant.kind in kinds() else None
    inputs = tuple(each.name for each in plant.inputs)
    return own is not None and OUTPUT in {c.name for c in own(inputs, (output.name,))}


def _refused(evidence: Evidence) -> bool:
    """Tell whether the fit would be refused, or outlasts what was recorded: astray, perhaps, for want of a level."""
    assert evidence.fit is not None
    plant = evidence.fit.plant
    if outlasting(plant, [experiments(plant, each, evidence.conditioning) for each in evidence.recordings]) is not None:
        return True
    try:
        judge(evidence.fit, evidence.recordings, evidence.conditioning)
    except IdentifyError:
        return True
    return False


def _best_with(evidence: Evidence, output: Signal, name: str, in_kind: bool, level: float, means: _Means) -> Fit | None:
    """Fit with the level, from the fit without it, the plant as given and a fit of deviations from the means.

    The fit without it may be far astray, to the other sign of a gain.
    """
    assert evidence.fit is not None
    reading = float(np.mean(evidence.recordings[0].columns[output.name]))
    ways: list[Fit] = []
    begins = ((evidence.fit.plant, level), (evidence.given, reading))
    for plant, start in chain(begins, _centred(evidence, output, means)):
        wider = _with_level(plant, output.unit) if in_kind else _with_offset(plant, output.name, name)
        begin = tuple(replace(p, value=start) if p.name == name else p for p in wider.parameters)
        try:
            after = estimate(replace(wider, parameters=begin), evidence.recordings, [], evidence.conditioning)
        except IdentifyError:
            continue
        ways.append(after)
        if _gain(evidence, evidence.fit, after) >= _CERTAIN:
            break
    return min(ways, key=lambda each: each.noise[output.name], default=None)


def _centred(evidence: Evidence, output: Signal, means: _Means) -> Iterator[tuple[Plant, float]]:
    """Yield the plant of a fit that no level takes part in, and the level beside it."""
    first = evidence.recordings[0]
    found = means()
    if found is None:
        return
    try:
        shown = simulate(found, first, rest_start(found, first))
    except IdentifyError:
        return
    index = [signal.name for signal in found.outputs].index(output.name)
    yield found, float(np.mean(first.columns[output.name] - shown[:, index]))


def _gain(evidence: Evidence, before: Fit, after: Fit) -> float:
    """Return by how much twice the log likelihood rises, in independent samples of what the better fit leaves."""
    left = remainders(replace(evidence, fit=after))
    return likelier(before.noise, after.noise, [part.residual for part in left])


def _with_level(plant: Plant, unit: str) -> Plant:
    """Give a lag its level of rest."""
    nominal = plant.parameters[: plant.rate.numel_in(2)]
    level = Parameter(OUTPUT, unit, 0.0, True, -math.inf, math.inf, None)
    (output,) = plant.outputs
    bare = kinds()[plant.kind].build(plant.inputs, (output,), (*nominal, level))
    return with_effects(bare, _uses(plant)) if plant.effects else bare


def _with_offset(plant: Plant, output: str, name: str) -> Plant:
    """Give a reading an offset."""
    short = name.rpartition(".")[2]
    return with_effects(plant, [*_uses(plant), EffectUse("sensor_offset", output, {short: 0.0}, (short,))])


def _uses(plant: Plant) -> list[EffectUse]:
    return [replace(use, values=values_of(plant, use)) for use in plant.effects]


CHECK = Check("rest", look, ("drift", "structure", "excitation"), True)

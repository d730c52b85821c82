"""An output that moves before its input does: no plant can, so that columns or clocks are shifted in the log.

The lag of each output behind the simulation of the fit is the peak of their cross-correlation. A fit has taken part of
a lead for quickness, so that fit and lag are found in turns; each pair leaves less than half of it, and of the outputs
that come early less than the pair before did: where more is left, it is no lead that the lag shows.

Beside an output that is read late, through a filter, a fit that has taken its lag for the plant's lets the others come
early. A shift of those would spoil what is sound: it is told only where no late reading of another output leaves less.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from types import MappingProxyType

import numpy as np

from firmloop.identify.fitting.check import Check
from firmloop.identify.fitting.checks import structure
from firmloop.identify.fitting.covariance import untold
from firmloop.identify.fitting.evidence import Evidence, sources_of
from firmloop.identify.fitting.fit import Fit, estimate, tried
from firmloop.identify.plants.attach import EffectUse, parameters_of, with_effects
from firmloop.identify.plants.effects import applies, effects, find_effect
from firmloop.identify.recordings.conditioning import find_lag, interpolate
from firmloop.identify.recordings.recording import Recording

_LONGEST = 0.1  # of a recording, that a lead is looked for
_ALIGNED = 0.25  # rows: more than that is half of what is left, or more
_TURNS = 8
_SMALLER = 0.6  # of what the fit leaves of an output: so little is left once it is shifted
_MENDED = 0.25  # of it, if it is no noise: beside friction 0.1 to 0.18 was left, beside a filter elsewhere 0.28 to 0.42
_BEGINS = (1.0, 4.0)  # leads, where the fit of a late reading begins


@dataclass(frozen=True, slots=True)
class _Shift:
    """A fit to outputs that come in time, and the rows by which each of them was early."""

    fit: Fit
    rows: Mapping[str, int]


def look(evidence: Evidence) -> tuple[str, ...]:
    """Say so where an output comes early, and much less than the fit has left is left of it in time."""
    assert evidence.fit is not None
    left = evidence.fit.noise
    shift = _shift(evidence, left)
    late = None if shift is None else _late(evidence, shift)
    said = _told_late(evidence, shift, late) if shift and late else _told(evidence, shift, left)
    return (said,) if said else ()


def early_outputs(evidence: Evidence, left: Mapping[str, float]) -> str:
    """Shift the outputs that come early until they come in time; tell them if much less than `left` of each is left.

    `left` is an rms by output, in its unit. Blank where none comes early.
    """
    shift = _shift(evidence, left)
    return "" if shift and _late(evidence, shift) else _told(evidence, shift, left)


def _shift(evidence: Evidence, left: Mapping[str, float]) -> _Shift | None:
    before = evidence.fit
    assert before is not None
    if evidence.conditioning.align or evidence.conditioning.window_s > 0.0:
        return None
    if all(lag > -_ALIGNED for lag in _lags(before, evidence.recordings).values()):
        return None
    after, early = _in_time(evidence, before)
    if not early or any(after.noise[name] > _SMALLER * left[name] for name in early):
        return None
    again = estimate(after.plant, evidence.recordings, (), evidence.conditioning, near=True, doubt=untold)
    if all(after.noise[name] > _SMALLER * again.noise[name] for name in early):
        return None  # the fit had not come to its end: from there it needs no shift
    return _Shift(after, early)


def _late(evidence: Evidence, shift: _Shift) -> Fit | None:
    """Return the best fit in which another output is read late, where that leaves less than the shift does."""
    given, about = evidence.given, max(shift.rows.values()) * _step(evidence.recordings[0])
    rivals = []
    others = [name for name in shift.fit.noise if name not in shift.rows]
    sensors = [each.name for each in effects().values() if each.place == "sensor" and applies(each, given)]
    for name, effect, times in product(others, sensors, _BEGINS):
        behind = parameters_of(given, effect, name)
        if [each.unit for each in behind] != ["s"]:  # by which it is late
            continue
        use = EffectUse(effect, name, {behind[0].name: times * about}, (behind[0].name,))
        if all(each.name != effect or each.output not in (None, name) for each in given.effects):
            rivals.append(tried(with_effects(given, [*given.effects, use]), evidence.recordings, evidence.conditioning))
    sizes = [(sum(map(math.log, each.noise.values())), each) for each in (shift.fit, *rivals) if each is not None]
    least = min(sizes, key=lambda pair: pair[0])[1]
    return None if least is shift.fit else least


def _in_time(evidence: Evidence, before: Fit) -> tuple[Fit, Mapping[str, int]]:
    """Return the fit to outputs that come in time, and the rows by which each was early; none where nothing settles."""
    rows = dict.fromkeys(before.noise, 0)
    fit, seen = before, list(evidence.recordings)
    for _ in range(_TURNS):
        lags = _lags(fit, seen)
        shifted = {name: max(count - _whole(lags[name]), 0) for name, count in rows.items()}
        if shifted == rows:
            return fit, {name: count for name, count in rows.items() if count}
        rows, seen = shifted, [_shifted(recording, shifted) for recording in evidence.recordings]
        after = tried(fit.plant, seen, evidence.conditioning, near=True)
        if after is None or all(after.noise[name] >= fit.noise[name] for name, count in rows.items() if count):
            break
        fit = after
    return before, {}


def _mended(evidence: Evidence, shift: _Shift, left: Mapping[str, float]) -> bool:
    """Tell whether the shift leaves noise, or next to nothing of what was left of an output."""
    if any(shift.fit.noise[name] <= _MENDED * left[name] for name in shift.rows):
        return True
    seen = tuple(_shifted(recording, shift.rows) for recording in evidence.recordings)
    return not structure.look(replace(evidence, recordings=seen, fit=shift.fit))


def _told_late(evidence: Evidence, shift: _Shift, late: Fit) -> str:
    assert evidence.fit is not None
    given = [(each.name, each.output) for each in evidence.given.effects]
    use = next(each for each in late.plant.effects if (each.name, each.output) not in given)
    behind = next(each for each in late.plant.parameters if each.name.startswith(f"{use.name}.{use.output}."))
    before = evidence.fit.noise
    early = max(shift.rows, key=lambda name: before[name] / late.noise[name])
    key, why = behind.name.rpartition(".")[2], find_effect(use.name).says
    left = f"{late.noise[early]:.3g} instead of {before[early]:.3g} {_unit(late, early)}"
    return (
        f"{use.output} of {sources_of(evidence.recordings)} is read late, for {why}: with a {key} of "
        f"{behind.value:.3g}, {left} rms is left of {early}; give the plant [[plant.effects]] with name = "
        f'"{use.name}", output = "{use.output}" and {key} = {{ value = {behind.value:.3g}, free = true }}'
    )


def _unit(fit: Fit, name: str) -> str:
    return next(signal.unit for signal in fit.plant.outputs if signal.name == name)


def _told(evidence: Evidence, shift: _Shift | None, left: Mapping[str, float]) -> str:
    if shift is None or not _mended(evidence, shift, left):
        return ""
    before, after, early = evidence.fit, shift.fit, shift.rows
    assert before is not None
    drive = " or ".join(each.name for each in before.plant.inputs)
    step = _step(evidence.recordings[0])
    sources = sources_of(evidence.recordings)
    said = [
        f"{name} of {sources} moves {rows} row{'s' if rows > 1 else ''} ({rows * step:.4g} s) before {drive} does"
        for name, rows in early.items()
    ]
    worst = min(early, key=lambda name: after.noise[name] / before.noise[name])
    longest = 1.5 * max(early.values()) * step
    names = ", ".join(f'"{name}"' for name in early)
    return (
        f"{' and '.join(said)}, which no plant can, for a row is read before its input acts: a column is shifted in "
        f"the log, or was read later. Once they come in time, "
        f"{after.noise[worst]:.3g} instead of {before.noise[worst]:.3g} {_unit(before, worst)} rms is left of {worst}: "
        f"move the column down by as many rows in the file, or let identify do so with align = [{names}] and "
        f"align_max_lag_s = {longest:.3g} in [recordings.conditioning]"
    )


def _lags(fit: Fit, recordings: Sequence[Recording]) -> dict[str, float]:
    """Return how many rows each output comes behind its simulation, the median of the recordings."""
    found: dict[str, float] = {}
    for k, name in enumerate(fit.noise):
        each = [
            find_lag(one.time, one.columns[name], score.simulated[:, k], _LONGEST * float(np.ptp(one.time)))
            / _step(one)
            for one, score in zip(recordings, fit.train, strict=True)
        ]
        found[name] = float(np.median(each))
    return found


def _whole(lag: float) -> int:
    """Return a lag in whole rows, away from zero."""
    return int(np.copysign(np.ceil(max(abs(lag) - _ALIGNED, 0.0)), lag))


def _step(recording: Recording) -> float:
    return float(np.median(np.diff(recording.time)))


def _shifted(recording: Recording, rows: Mapping[str, int]) -> Recording:
    """Let each output come as many rows later, and drop the rows before the first that is left of all."""
    time, step = recording.time, _step(recording)
    first = int(np.searchsorted(time, time[0] + max(rows.values()) * step * (1.0 - 1e-9)))
    columns = {
        name: (interpolate(time, column, time - rows[name] * step) if rows.get(name) else column)[first:]
        for name, column in recording.columns.items()
    }
    return replace(recording, time=time[first:], columns=MappingProxyType(columns))


CHECK = Check("early", look, ("rest", "drift", "structure", "excitation", "far_from_given"), True)

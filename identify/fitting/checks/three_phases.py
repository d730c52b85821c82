"""A log of a three-phase machine that contradicts itself: pole pairs, order of phases, their sum, the angle's unit.

None of it needs the parameters. With u, i, w as logged, from row to row (h apart)::

    i_d[k+1] - i_d = h (v_d/Ld - R/Ld i_d + A w i_q)        i_q[k+1] - i_q = h (v_q/Lq - R/Lq i_q - B w i_d - C w)

A B = p^2, whatever Ld and Lq are: the pole pairs. Phases that the wrong pole pairs turn into the rotor's frame, or one
with its sign turned, leave far more over in this than the right ones. Phases in their order show currents along the
axes that stand still, or turn backwards where they settle; of two that are swapped they turn twice as fast backwards.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from firmloop.identify.fitting.check import Check
from firmloop.identify.fitting.evidence import Evidence
from firmloop.identify.fitting.least_squares import regressed
from firmloop.identify.recordings.recording import Recording
from firmloop.identify.recordings.rotor_frame import CURRENTS, DUTIES, PHASES, VOLTAGES, RotorFrame, rotor_frame, stator
from firmloop.identify.simulation.bridge_columns import pace

Array = NDArray[np.float64]

_ROWS = 50  # at least, to judge by
_SMALL = 0.5  # of the largest current
_SURE = 0.1  # relative standard deviation of p^2
_NEAR = 0.25  # of a factor: what two neighbouring whole numbers of pole pairs differ by, at most
_MOST_PAIRS, _MOST_ROWS = 30, 20_000  # that phase currents are asked for
_ITSELF = 0.1  # relative: a number of pole pairs that the currents turned by it show again
_CERTAIN = 5.0  # standard deviations
_BETTER = 0.25  # of the squares that the given pole pairs leave
_BACKWARDS = -1.3  # of the electrical turn: 0 to -1 of phases in their order, -1 to -2 of two that are swapped
_TURNS = 2.0  # electrical ones that a log must see
_EVERY = slice(None)
_EXCHANGED = (CURRENTS, VOLTAGES, *combinations(DUTIES, 2))
_SUM = 0.05  # of the largest current
_SLIP = 0.02
_ANGLES = (("degrees", 180.0 / math.pi, "deg"), ("turns", 0.5 / math.pi, "turn"))
_SPEEDS = (
    ("revolutions per minute", 30.0 / math.pi, "rpm"),
    ("degrees a second", 180.0 / math.pi, "deg/s"),
    ("revolutions a second", 0.5 / math.pi, "rev/s"),
)


def look(evidence: Evidence) -> tuple[str, ...]:
    """Ask each recording of a pmsm; the first contradiction of each kind is told, but none beside an exchange."""
    if evidence.given.kind != "pmsm":
        return ()
    pairs = next(p.value for p in evidence.given.parameters if p.name == "pole_pairs")
    told = [recording for recording in evidence.recordings if len(recording.time) >= _ROWS]
    found = [next(filter(None, (ask(one, pairs) for one in told)), "") for ask in (_angle, _sum, _order, _exchanged)]
    if not any(found[2:]):
        found += [next(filter(None, (ask(one, pairs) for one in told)), "") for ask in (_signs, _against, _pairs)]
    return tuple(one for one in found if one)


def _columns(recording: Recording, *names: str) -> list[Array] | None:
    """Return columns, or None where one is missing."""
    if any(name not in recording.columns for name in names):
        return None
    return [recording.columns[name] for name in names]


def _pairs(recording: Recording, pairs: float) -> str:
    frame = rotor_frame(recording.columns, pairs)
    if frame is None:
        return ""
    if CURRENTS[0] not in recording.columns:
        seen = _pairs_of_phases(recording, pairs)
    else:
        size = np.abs(frame.current)
        small = np.maximum(size[1:], size[:-1]) < _SMALL * np.max(size)  # iron saturates at the others
        seen = _pairs_of_axes(recording.time, frame, small, pairs)
    if seen is None:
        return ""
    says = f"pole_pairs = {pairs:g}, but the currents of {recording.source} fit {seen:.3g}: "
    for name, times, unit in _SPEEDS:
        if abs(math.log(pairs / seen / times)) < _SLIP:
            return (
                f'{says}speed_rad_s looks like {name}; write speed = {{ name = "speed_rad_s", unit = "{unit}" }} in '
                "[recordings.rename]"
            )
    off = f"speed_rad_s is off by a factor of {pairs / seen:.3g}"
    if round(seen) == 0 or abs(math.log(seen / round(seen))) > math.log1p(_SURE):
        return f"{says}no whole number; {off}: give the column its unit in [recordings.rename]"
    turned = "the electrical speed" if round(seen) == 1 else "off by that factor"
    return (
        f"{says}correct pole_pairs to {round(seen)}, or speed_rad_s is {turned}: give the column its unit in "
        "[recordings.rename]"
    )


def _pairs_of_axes(time: Array, frame: RotorFrame, told: NDArray[np.bool_], pairs: float) -> float | None:
    """Return what the rows that are `told` show, where the given pole pairs leave far more of them; None elsewhere.

    Axes that rock about the magnets bend A and B, but the pole pairs as given leave little more.
    """
    free = _seen(time, frame, told)
    if free.pairs is None or abs(math.log(free.pairs / pairs)) < math.log1p(_NEAR):
        return None
    given = [factor * pairs / free.pairs for factor in free.cross]
    return free.pairs if free.left < _BETTER * _left_beside(time, frame, told, given) else None


def _pairs_of_phases(recording: Recording, pairs: float) -> float | None:
    """Return what the phases show where other pole pairs turn them into a rotor's frame far better; None elsewhere."""
    part = {name: values[:_MOST_ROWS] for name, values in recording.columns.items()}  # each number is a pass over them

    def turned(asked: float) -> _Seen:
        return _seen_in(recording.time[:_MOST_ROWS], part, asked)

    known = turned(pairs).left
    found = {float(asked): turned(asked) for asked in range(1, _MOST_PAIRS + 1)}
    best = min(found, key=lambda asked: found[asked].left)
    seen, left = found[best].pairs, found[best].left
    return best if seen is not None and abs(seen / best - 1.0) < _ITSELF and left < _BETTER * known else None


def _signs(recording: Recording, pairs: float) -> str:
    read = {name: values for name, values in recording.columns.items() if name not in CURRENTS}
    known = _seen_in(recording.time, read, pairs).left
    for name in PHASES if known < math.inf else ():
        seen = _seen_in(recording.time, {**read, name: -read[name]}, pairs)
        if seen.upright and seen.left < _BETTER * known:
            return (
                f"{name} of {recording.source} looks turned around: with its sign changed the currents follow the "
                'voltages far better; give the column "scale = -1" in [recordings.rename], or turn the sensor'
            )
    return ""


def _exchanged(recording: Recording, pairs: float) -> str:
    known = _seen_in(recording.time, recording.columns, pairs).left
    found = {}
    for one, other in _EXCHANGED:
        if one in recording.columns and other in recording.columns:
            held = recording.columns
            seen = _seen_in(recording.time, {**held, one: held[other], other: held[one]}, pairs)
            if seen.upright and seen.left < _BETTER * known:
                found[one, other] = seen.left
    if not found:
        return ""
    one, other = min(found, key=lambda pair: found[pair])
    return (
        f"{one} and {other} of {recording.source} look exchanged: the other way round the currents follow the voltages "
        "far better; exchange the two names in the file's header or in [recordings.rename]"
    )


def _against(recording: Recording, pairs: float) -> str:
    down = _seen_in(recording.time, recording.columns, pairs).down if CURRENTS[0] in recording.columns else ""
    against = [f"current_{axis}_A runs against voltage_{axis}_V" for axis in down]
    if not against:
        return ""
    return f"{' and '.join(against)} in {recording.source}: turn one of each by scale = -1 in [recordings.rename]"


@dataclass(frozen=True, slots=True)
class _Seen:
    """Pole pairs, None if unsure; the squares left over in A^2; whether the voltages drive the currents upwards.

    `down` names the axes whose voltage drives the current downwards beyond doubt, `cross` are A and -B.
    """

    pairs: float | None
    left: float
    upright: bool
    down: str = ""
    cross: tuple[float, float] = (0.0, 0.0)


def _seen_in(time: Array, columns: Mapping[str, Array], pairs: float) -> _Seen:
    """Return what a log shows that holds voltages, currents and speed; of any other nothing, which leaves all."""
    frame = rotor_frame(columns, pairs)
    return _Seen(None, math.inf, False) if frame is None else _seen(time, frame)


def _rows(time: Array, frame: RotorFrame) -> tuple[tuple[str, Array, Array], ...]:
    """Return of each axis its name, what its current rises by as (n - 1, k), the cross term third, and its rise."""
    h, i_d, i_q, w = np.diff(time), frame.current.real, frame.current.imag, frame.speed
    middle = [(one[1:] + one[:-1]) / 2.0 for one in (i_d, i_q, w)]
    along = np.column_stack([frame.voltage.real[:-1], middle[0], middle[2] * middle[1]]) * h[:, None]
    across = np.column_stack([frame.voltage.imag[:-1], middle[1], middle[2] * middle[0], middle[2]]) * h[:, None]
    return ("d", along, np.diff(i_d)), ("q", across, np.diff(i_q))


def _left_beside(time: Array, frame: RotorFrame, told: NDArray[np.bool_], cross: Sequence[float]) -> float:
    """Return the squares in A^2 that are left over of the rows that are `told`, where the cross terms are given."""
    left = 0.0
    for (_, regressors, change), factor in zip(_rows(time, frame), cross, strict=True):
        others = np.delete(regressors, 2, axis=1)[told]
        rest = (change - factor * regressors[:, 2])[told]
        rest = rest - others @ np.linalg.lstsq(others, rest, rcond=None)[0]
        left += float(rest @ rest)
    return left


def _seen(time: Array, frame: RotorFrame, told: NDArray[np.bool_] | slice = _EVERY) -> _Seen:
    """Return what voltages, speed and the current show, in the rows that are `told`."""
    factors, doubts, over, upright, down = [], [], 0.0, True, ""
    for axis, regressors, change in _rows(time, frame):
        seen = regressed(regressors[told], change[told])
        if seen is None:
            return _Seen(None, math.inf, False)
        found, deviations, left = seen
        over, upright = over + left, upright and bool(found[0] > 0.0)
        down += axis if found[0] < -_CERTAIN * deviations[0] else ""
        factors.append(float(found[2]))
        doubts.append(float(deviations[2]) / max(abs(float(found[2])), 1e-300))
    square = -factors[0] * factors[1]
    pairs = math.sqrt(square) if square > 0.0 and math.hypot(*doubts) <= _SURE else None
    return _Seen(pairs, over, upright, down, (factors[0], factors[1]))


def _order(recording: Recording, pairs: float) -> str:
    read = _columns(recording, "current_a_A", "current_b_A", "position_rad")
    if read is None:
        return ""
    a, b, position = read
    angle = pairs * position
    if np.ptp(angle) < _TURNS * 2.0 * math.pi:
        return ""
    current = stator(a, b) * np.exp(-1j * angle)
    turned, moved = np.angle(np.conj(current[:-1]) * current[1:]), np.diff(angle)
    size = np.abs(current[1:] * current[:-1])
    told = (np.abs(moved) > 0.1 * np.max(np.abs(moved))) & (size > 0.1 * np.max(size))
    if not np.any(told) or float(np.median(turned[told] / moved[told])) > _BACKWARDS:
        return ""
    return (
        f"current_a_A and current_b_A of {recording.source} look swapped: along the axes they turn backwards, twice "
        "an electrical turn, and stand still the other way round; exchange the columns or two phases, or turn the "
        "sign of position_rad"
    )


def _sum(recording: Recording, pairs: float) -> str:
    read = _columns(recording, "current_a_A", "current_b_A", "current_c_A")
    if read is None:
        return ""
    total = np.sum(read, axis=0)
    largest = max(float(np.max(np.abs(one))) for one in read)
    mean, rms = float(np.mean(total)), float(np.sqrt(np.mean(total**2)))
    if rms < _SUM * largest:
        return ""
    cause = "an offset of a sensor: subtract it" if abs(mean) > 0.7 * rms else "a sensor's gain, or one that is clipped"
    return (
        f"the three phase currents of {recording.source} do not sum up to 0 (mean {mean:.3g} A, rms {rms:.3g} A, "
        f"beside {largest:.3g} A at most): {cause}; with a star point two of them are enough: leave the third out"
    )


def _angle(recording: Recording, pairs: float) -> str:
    read = _columns(recording, "position_rad", "speed_rad_s")
    if read is None:
        return ""
    position, speed = read
    factor = pace(np.diff(position), (speed[1:] + speed[:-1]) / 2.0 * np.diff(recording.time))
    if factor is None:
        return ""
    if abs(math.log(max(-factor, 1e-300))) < math.log1p(_NEAR):
        return (
            f"position_rad of {recording.source} moves against speed_rad_s: change the sign of one of the columns by "
            "scale = -1 in [recordings.rename]"
        )
    if not factor > 0.0 or abs(math.log(factor)) < math.log1p(_NEAR):
        return ""
    for name, times, unit in _ANGLES:
        if abs(math.log(factor / times)) < _SLIP:
            return (
                f"position_rad of {recording.source} moves {factor:.4g} times as fast as speed_rad_s says: it looks "
                f'like {name}; write position = {{ name = "position_rad", unit = "{unit}" }} in [recordings.rename]'
            )
    if abs(math.log(factor / pairs)) < _SLIP:
        return (
            f"position_rad of {recording.source} moves {factor:.4g} times as fast as speed_rad_s says, the pole pairs: "
            "it looks electrical; divide it by pole_pairs: scale in [recordings.rename]"
        )
    return (
        f"position_rad of {recording.source} moves {factor:.4g} times as fast as speed_rad_s says: it looks "
        f"like counts, {2.0 * math.pi * factor:.0f} a turn; give the column the scale 6.283185307 / counts in "
        "[recordings.rename], with the exact counts a turn"
    )


CHECK = Check(
    "three_phases",
    look,
    ("electrical_scale", "sign", "scale", "structure", "excitation", "rest", "drift"),
    False,
    ("identify", "diagnose"),
)

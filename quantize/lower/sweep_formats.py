"""Round the sweeps of a quadratic program to a number format, and bound what that does.

In fixed point everything inside stands at one fraction, the finest at which no sum can overflow: each sum's largest
value follows from the table's own integers, the limits of what is swept and the ranges of the parameters.

No sweep takes two starts farther apart (`design/quadratic/splitting.py`), in the root of the sum of squares. So the
distance of the program from the law grows by at most what one sweep rounds, `times` times.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from firmloop.design.law import Sweeps
from firmloop.design.quadratic.splitting import STEP
from firmloop.quantize.lower.builder import Term
from firmloop.quantize.program import QuantizeError, Table

Array = NDArray[np.float64]

WORD, LONG = 2**31 - 1, 2**63 - 1
MOST_SHIFT, MIX_SHIFT = 62, 30
FINEST = 30
FAR = 1e30  # a limit that is none
LAW = 2.0**-53  # rounding of the law's own evaluation
SAYS = "the sweeps of a quadratic program in {} rows and {} parameters"


@dataclass(frozen=True, slots=True)
class Planned:
    """A table, the operation that reads it, the raw ends of its moves, and how far they may be from the law's."""

    function: str
    table: Table
    low: float
    high: float
    error: float


def float_sweeps(sweeps: Sweeps, parameters: Sequence[Term], arithmetic: str, name: str) -> Planned:
    """Round to "float32" or "float64"; the members are those of `fl_sweeps_t` in fl_sweeps.h."""
    kind = np.dtype(arithmetic).type
    count, size = sweeps.slope.shape
    width = -(-count // 4) * 4

    def rounded(values: Array) -> tuple[float, ...]:
        return tuple(float(x) for x in np.clip(values, -FAR, FAR).astype(kind).ravel())

    def columns(values: Array) -> tuple[float, ...]:
        return rounded(np.pad(values, ((0, width - count), (0, 0))).T)

    sizes = {
        "FL_QP_ROWS": count, "FL_QP_WIDTH": width, "FL_QP_PARAMETERS": size, "FL_QP_MOVES": len(sweeps.scale),
        "FL_SWEEPS": sweeps.times,
    }  # fmt: skip
    numbers: dict[str, tuple[float, ...] | float] = {
        "slope": columns(sweeps.slope),
        "push": columns(sweeps.push),
        "mix": columns(sweeps.mix),
        "low": rounded(sweeps.low),
        "high": rounded(sweeps.high),
        "scale": rounded(sweeps.scale),
        "reach": float(kind(sweeps.reach)),
        "tolerance": float(kind(min(sweeps.tolerance, FAR))),
    }
    says = SAYS.format(count, size)
    table = Table(name, says, "fl_sweeps_t", "fl_sweeps.h", tuple(sizes.items()), tuple(numbers.items()))
    unit = (2.0**-24 if arithmetic == "float32" else 2.0**-53) + LAW
    largest = np.array([max(abs(p.low), abs(p.high)) for p in parameters])
    off = np.array([p.error for p in parameters])
    free = np.abs(sweeps.slope) @ (off + (size + 2) * unit * largest)
    push = np.abs(sweeps.push) @ (off + (size + 2) * unit * largest)
    pushed = np.abs(sweeps.push) @ largest
    mirrored = _mirrored(sweeps.low, sweeps.high, sweeps.reach)
    mixed = np.abs(sweeps.mix) @ mirrored
    row = push + unit * ((count + 4) * mixed + (count + 2) * pushed + np.abs(sweeps.mix) @ mirrored)
    limit = unit * np.where(np.isfinite(sweeps.low + sweeps.high), np.maximum(-sweeps.low, sweeps.high), 0.0)
    updated = 3 * unit * (STEP * (mixed + pushed + mirrored) + sweeps.reach) + unit * sweeps.reach
    error = _error(sweeps, free, row, limit, updated)
    drives = len(sweeps.scale)
    ends = np.abs(np.concatenate([sweeps.low[:drives], sweeps.high[:drives]])) * np.tile(sweeps.scale, 2)
    top = float(np.max(ends))
    return Planned("sweeps", table, -(1 + 4 * unit) * top, (1 + 4 * unit) * top, error + 3 * unit * top)


def fixed_sweeps(sweeps: Sweeps, parameters: Sequence[Term], q: int, name: str) -> Planned:
    """Round to fixed point, the moves at fraction `q`; the members are those of `fl_sweeps_t` in fl_sweeps_i32.h.

    Raises
    ------
    QuantizeError
        when the ranges leave no fraction at which no sum overflows.
    """
    largest = [max(-int(p.low), int(p.high)) for p in parameters]
    for fraction in range(FINEST, -FINEST, -1):
        found = _at(sweeps, parameters, largest, fraction)
        if found is not None:
            break
    else:
        raise QuantizeError(
            "the parameters of the quadratic program range too far for fixed point; narrow the ranges in [signals], "
            "rescale them, or use float32"
        )
    count, size = sweeps.slope.shape
    drives, ulp = len(sweeps.scale), 2.0**-fraction
    width = -(-count // 4) * 4
    least = [math.ceil(x * 2.0**q) for x in sweeps.low[:drives] * sweeps.scale]
    most = [math.floor(x * 2.0**q) for x in sweeps.high[:drives] * sweeps.scale]
    top = max(-min(least), max(most))
    scale_shift = _shift([[x * 2.0 ** (q - fraction)] for x in sweeps.scale], [found.reach])
    sizes = {
        "FL_QP_ROWS": count, "FL_QP_WIDTH": width, "FL_QP_PARAMETERS": size, "FL_QP_MOVES": drives,
        "FL_SWEEPS": sweeps.times, "FL_SHIFT_SLOPE": found.slope_shift, "FL_SHIFT_PUSH": found.push_shift,
        "FL_SHIFT_MIX": MIX_SHIFT, "FL_SHIFT_SCALE": scale_shift,
    }  # fmt: skip
    scale = [_near(x * 2.0 ** (q - fraction + scale_shift)) for x in sweeps.scale]
    numbers: dict[str, tuple[float, ...] | float] = {
        "slope": _flat(found.slope),
        "push": _flat(found.push),
        "mix": (*_flat(found.mix), *[0] * (width - count) * count),
        "low": tuple(found.low),
        "high": tuple(found.high),
        "scale": tuple(scale),
        "least": tuple(least),
        "most": tuple(most),
        "reach": found.reach,
        "tolerance": min(WORD, _near(min(sweeps.tolerance, FAR) / ulp)),
    }
    says = SAYS.format(count, size) + f", Q{fraction} inside"
    table = Table(name, says, "fl_sweeps_t", "fl_sweeps_i32.h", tuple(sizes.items()), tuple(numbers.items()))
    error = _fixed_error(sweeps, parameters, found, ulp)
    moved = max(abs(x - s * 2.0 ** (fraction - q - scale_shift)) for x, s in zip(sweeps.scale, scale, strict=True))
    return Planned("sweeps", table, -top, top, error + moved * found.reach * ulp + 1.5 * 2.0**-q)


@dataclass(frozen=True, slots=True)
class _Integers:
    slope: list[list[int]]
    push: list[list[int]]
    mix: list[list[int]]
    low: list[int]
    high: list[int]
    reach: int
    slope_shift: int
    push_shift: int


def _at(sweeps: Sweeps, parameters: Sequence[Term], largest: list[int], fraction: int) -> _Integers | None:
    """Return the integers at a fraction; None where a sum could overflow."""
    one = 2.0**fraction
    reach = _near(sweeps.reach * one)
    if reach > WORD // 2:
        return None
    low = [_near(max(x * one, -reach)) for x in sweeps.low]
    high = [_near(min(x * one, reach)) for x in sweeps.high]
    mix = [[_near(x * 2.0**MIX_SHIFT) for x in row] for row in sweeps.mix]
    parts, shifts = [], []
    for matrix in (sweeps.slope, sweeps.push):
        real = [
            [x * 2.0 ** (fraction - p.number.fraction) for x, p in zip(row, parameters, strict=True)] for row in matrix
        ]
        shift = _shift(real, largest)
        if shift < 1:
            return None
        shifts.append(shift)
        parts.append([[_near(x * 2.0**shift) for x in row] for row in real])
    mirrored = [int(x) for x in _mirrored(np.array(low), np.array(high), reach)]
    for pushing, mixing, down, up in zip(parts[1], mix, low, high, strict=True):
        pushed = (_sum(pushing, largest) >> shifts[1]) + 1
        mixed = _sum(mixing, mirrored)
        y = pushed + (mixed >> MIX_SHIFT) + 1
        away = y + max(-down, up)
        if pushed > WORD or mixed > LONG // 2 or y > WORD or 7 * away + 2 > WORD or reach + 2 * away + 1 > WORD:
            return None
    return _Integers(parts[0], parts[1], mix, low, high, reach, *shifts)


def _shift(rows: list[list[float]], largest: list[int]) -> int:
    """Return the most places behind the point for these weights such that weights and sums fit."""
    weight = max(abs(x) for row in rows for x in row)
    total = max(sum(abs(x) * most for x, most in zip(row, largest, strict=True)) for row in rows)
    room = min(WORD / weight if weight else math.inf, LONG / 4 / total if total else math.inf)
    return min(MOST_SHIFT, math.floor(math.log2(room))) if math.isfinite(room) else MOST_SHIFT


def _sum(row: list[int], largest: list[int]) -> int:
    return sum(abs(x) * most for x, most in zip(row, largest, strict=True))


def _near(value: float) -> int:
    return math.floor(value + 0.5)


def _flat(rows: list[list[int]]) -> tuple[int, ...]:
    return tuple(x for row in rows for x in row)


def _mirrored(low: Array, high: Array, reach: float) -> Array:
    """Return the largest |2 c - s| of each row, with s within reach and c that within the limits."""
    down, up = np.maximum(low, -reach), np.minimum(high, reach)
    found: Array = np.maximum(np.maximum(-down, up), np.maximum(reach - 2 * up, reach + 2 * down))
    return found


def _fixed_error(sweeps: Sweeps, parameters: Sequence[Term], found: _Integers, ulp: float) -> float:
    sizes = np.array([max(-p.low, p.high) * 2.0**-p.number.fraction for p in parameters])
    off = np.array([p.error for p in parameters])
    grids = np.array([2.0**p.number.fraction for p in parameters])
    errors = []
    for raw, real, shift in (
        (found.slope, sweeps.slope, found.slope_shift),
        (found.push, sweeps.push, found.push_shift),
    ):
        wrong = np.abs(np.array(raw, dtype=np.float64) * ulp * 2.0**-shift * grids - real)
        errors.append(wrong @ sizes + np.abs(real) @ off + 0.5 * ulp)
    mirrored = _mirrored(np.array(found.low), np.array(found.high), found.reach) * ulp
    mixing = np.abs(np.array(found.mix, dtype=np.float64) * 2.0**-MIX_SHIFT - sweeps.mix) @ mirrored
    row = errors[1] + mixing + 0.5 * ulp + 4 * LAW * (np.abs(sweeps.mix) @ mirrored + np.abs(sweeps.push) @ sizes)
    return _error(sweeps, errors[0], row, np.full(len(row), 0.5 * ulp), np.full(len(row), ulp))


def _error(sweeps: Sweeps, free: Array, row: Array, limit: Array, updated: Array) -> float:
    """Return how far a move may be off in the end.

    `free` bounds the errors at the start, `row` those of a y, `limit` of the limits, `updated` of what a sweep ends in;
    each (rows,). A limit that is off by e moves c by at most e, and s by STEP (2 |mix| + 1) e, with |mix| at most 1.
    """
    one = float(np.linalg.norm(STEP * row + updated) + 3 * STEP * np.linalg.norm(limit))
    total = float(np.linalg.norm(free)) + sweeps.times * one
    drives = len(sweeps.scale)
    off = np.linalg.norm(sweeps.mix[:drives], axis=1) * (total + 2 * np.linalg.norm(limit)) + row[:drives]
    return float(np.max((off + limit[:drives]) * sweeps.scale))

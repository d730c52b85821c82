"""Search one quadratic program after the other as `fl_qp.h` does, compiled from this Python when first used.

The functions are those of `fl_qp_search.h` without their prefix, and what they compute is the same in every bit: a
number keeps its type, every product is rounded before it is added. What is kept of the rows, a tableau or a factor, is
a module of its own. See `quantize/twins/qp.py` for the method. Nothing but time is won by the compiler (numba, kept for
the next run): a search is some ten thousand numbers, one after the other.
"""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

import numba

from firmloop.design.outcome import CAPPED, COLUMN, INFEASIBLE, SOLVED
from firmloop.quantize.twins import qp_factor, qp_tableau
from firmloop.quantize.twins.qp_memory import (
    FRESH,
    HARD,
    LENGTH,
    WORK,
    QpProblem,
    QpSearch,
    Raw,
    compiled,
    is_hard,
    most_violated,
)


@compiled
def _pivot(q: QpProblem, s: QpSearch, row: int) -> Any:
    return s.own[qp_factor.PIVOT] if q.many else s.eta[s.counts[LENGTH], row]


@compiled
def _reached(q: QpProblem, s: QpSearch, row: int) -> Any:
    return s.own[qp_factor.REACHED] if q.many else s.value[row]


@compiled
def _rate(q: QpProblem, s: QpSearch, place: int) -> Any:
    return s.rate[place] if q.many else s.eta[s.counts[LENGTH], s.active[place]]


@compiled
def _multiplier(q: QpProblem, s: QpSearch, place: int) -> Any:
    return s.multiplier[place] if q.many else s.value[s.active[place]]


@compiled
def _free(q: QpProblem, s: QpSearch, row: int) -> bool:
    filled = q.moves > 0 and s.counts[HARD] == q.moves and is_hard(q, row)
    return _pivot(q, s, row) > q.least and s.counts[LENGTH] < q.room and not filled


@compiled
def _beyond(q: QpProblem, row: int, parameters: Raw, moves: Raw) -> Any:
    shift, onward = q.shift[row], q.onward[row]
    value = shift[0] * parameters[0]
    for j in range(1, len(parameters)):
        value += shift[j] * parameters[j]
    for j in range(q.moves):
        value += onward[j] * moves[j]
    return value


@compiled
def _held(q: QpProblem, s: QpSearch, row: int) -> Any:
    if s.side[row] == 0:
        return s.value[row]
    return q.high[row] if s.side[row] > 0 else q.low[row]


@compiled
def _residual(q: QpProblem, s: QpSearch, parameters: Raw) -> None:
    column = s.spare
    for i in range(q.moves):
        value = q.slope[0, i] * parameters[0]
        for j in range(1, len(parameters)):
            value += q.slope[j, i] * parameters[j]
        for k in range(s.counts[LENGTH]):
            value -= q.gram[s.active[k], i] * s.value[s.active[k]]
        column[i] = value
    for i in range(q.moves, len(q.low)):
        column[i] = _beyond(q, i - q.moves, parameters, column)
    for k in range(s.counts[LENGTH]):
        row = s.active[k]
        if row >= q.moves:
            column[row] -= q.softness[row - q.moves] * s.value[row]
    for i in range(len(q.low)):
        column[i] -= _held(q, s, i)


@compiled
def _refine(q: QpProblem, s: QpSearch, parameters: Raw) -> tuple[int, int]:
    """Return whether every move is near and keeps the hard rows that are active, and the row to enter next."""
    s.counts[WORK] += 2 * s.counts[LENGTH] + q.moves + COLUMN
    _residual(q, s, parameters)
    column = s.spare
    qp_tableau.correct(q, s, column)
    near = 1
    for i in range(len(q.low)):
        error = column[i]
        s.value[i] += error
        if i < q.moves and s.side[i] == 0 and not (error < q.trusted and error > -q.trusted):
            near = 0
    for i in range(q.moves):
        column[i] = _held(q, s, i)
    for i in range(q.moves, len(q.low)):
        value = _beyond(q, i - q.moves, parameters, column)
        if s.side[i] == 0:
            s.value[i] = value
        elif is_hard(q, i):
            missed = value - _held(q, s, i)
            if not (missed < q.kept and missed > -q.kept):
                near = 0
    return near, most_violated(q, s, q.tolerance)


@compiled
def _step(q: QpProblem, s: QpSearch, gap: Any, row: int, sign: Any) -> tuple[Any, int]:
    step, place = (gap * sign / _pivot(q, s, row) if _free(q, s, row) else q.far), -1
    for k in range(s.counts[LENGTH]):
        toward = s.toward[k]
        rate = _rate(q, s, k) * (sign * toward)
        if rate > q.least:
            ratio = _multiplier(q, s, k) * toward / rate
            if ratio < step:
                step = ratio
                place = k
    return step, place


@compiled
def _enter(q: QpProblem, s: QpSearch, parameters: Raw, row: int) -> tuple[int, int]:
    """Return the status, and the row to enter next."""
    above = s.value[row] > q.high[row]
    sign = q.one if above else -q.one
    limit = q.high[row] if above else q.low[row]
    multiplier = q.none
    if q.many:
        qp_factor.begin(q, s, row)
    else:
        qp_tableau.begin(q, s, row)
    if q.moves and not s.counts[FRESH] and not _free(q, s, row):
        s.counts[FRESH], following = _refine(q, s, parameters)
        return (SOLVED if s.counts[WORK] < q.budget else CAPPED), following
    while s.counts[WORK] < q.budget:
        step, place = _step(q, s, _reached(q, s, row) - limit, row, sign)
        if step >= q.far:
            return INFEASIBLE, row
        multiplier += step * sign
        if place < 0:
            if q.moves:
                noise = multiplier * sign * q.noise
                s.tolerance[0] = noise if noise > s.tolerance[0] else s.tolerance[0]
                s.counts[FRESH] = 0
                s.counts[HARD] += 1 if is_hard(q, row) else 0
            s.side[row] = 1 if above else -1
            if q.many:
                return SOLVED, qp_factor.join(q, s, row, step * sign, multiplier, sign)
            return SOLVED, qp_tableau.join(q, s, row, step * sign, multiplier, sign)
        if q.many:
            qp_factor.go(s, step * sign)
            qp_factor.leave(q, s, place, row)
        else:
            qp_tableau.go(q, s, step * sign)
            qp_tableau.leave(q, s, place)
    return CAPPED, row


@compiled
def _believed(q: QpProblem, s: QpSearch) -> int:
    for k in range(s.counts[LENGTH]):
        if q.kept < q.far and not (_multiplier(q, s, k) * s.toward[k] * q.noise < q.kept):
            return CAPPED
    return SOLVED


@compiled
def _search(q: QpProblem, s: QpSearch, row: int, parameters: Raw) -> int:
    for i in range(len(s.counts)):
        s.counts[i] = 0
    for i in range(len(s.value)):
        s.start[i] = s.value[i]
    status = SOLVED
    while row >= 0 and status == SOLVED:
        status, row = _enter(q, s, parameters, row)
        while q.moves and status == SOLVED and row < 0:
            near, row = _refine(q, s, parameters)
            if near:
                break
            status = SOLVED if s.counts[WORK] < q.budget else CAPPED
    if not q.moves and status == SOLVED:
        status = _believed(q, s)
    return status


def _kept(sources: str) -> Any:
    """Compile `search_all`; what numba kept of other sources than these is not taken: it asks for this file alone."""

    @numba.njit(cache=True, error_model="numpy")
    def search_all(q: QpProblem, s: QpSearch, parameters: Raw, moves: Raw, status: Raw, work: Raw, side: Raw) -> None:
        """Search for every row of `parameters` (lanes, p); fill `moves`, not yet scaled, and what the searches did."""
        for lane in range(len(parameters) if sources else 0):
            own = parameters[lane]
            for i in range(len(q.low)):
                value = q.slope[0, i] * own[0]
                for j in range(1, len(own)):
                    value += q.slope[j, i] * own[j]
                s.value[i] = value
                s.side[i] = 0
            row = most_violated(q, s, q.tolerance)
            for i in range(moves.shape[1]):
                moves[lane, i] = s.value[i]
            if row < 0:
                continue
            over, under = s.value[row] - q.high[row], q.low[row] - s.value[row]
            s.tolerance[0] = q.tolerance + (over if over > under else under) * q.share
            status[lane] = _search(q, s, row, own)
            work[lane] = s.counts[WORK]
            for i in range(len(q.low)):
                side[lane, i] = s.side[i]
                if status[lane] == SOLVED and i < moves.shape[1]:
                    moves[lane, i] = _held(q, s, i)

    return search_all


_PARTS = [Path(__file__).with_name(f"{name}.py") for name in ("qp_memory", "qp_tableau", "qp_factor")]
search_all = _kept(hashlib.sha256(b"".join(part.read_bytes() for part in _PARTS)).hexdigest())

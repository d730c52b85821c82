"""Search one quadratic program after the other as `fl_qp.h` does, compiled from this Python when first used.

The functions are those of `fl_qp.h` and `fl_qp_tableau.h` without their prefix, and what they compute is the same in
every bit: a number keeps its type, every product is rounded before it is added. See `quantize/twins/qp.py` for the
method. Nothing but time is won by the compiler (numba, kept for the next run): a search is some ten thousand numbers,
one after the other.

Whole slices are not assigned: what numba takes for their errors compiles longer than all the rest.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numba
from numpy.typing import NDArray

from firmloop.design.outcome import CAPPED, COLUMN, INFEASIBLE, SOLVED

Raw = NDArray[Any]

LENGTH, WORK, FRESH, HARD = range(4)  # places of `QpSearch.counts`

WITHIN: dict[str, Any] = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}  # only compiled code calls it

compiled = numba.njit(error_model="numpy", **WITHIN)


class QpProblem(NamedTuple):
    """What `fl_qp_t` and the sizes beside it hold, in one element type; `moves` is 0 where answers are not checked."""

    slope: Raw  # (p, m)
    low: Raw
    high: Raw
    gram: Raw
    tolerance: Any
    share: Any
    trusted: Any
    kept: Any
    noise: Any
    least: Any
    far: Any
    none: Any  # 0
    one: Any
    room: int
    budget: int
    moves: int
    shift: Raw  # (c, p)
    onward: Raw  # (c, moves)
    softness: Raw


class QpSearch(NamedTuple):
    """What `fl_search_t` holds; `counts` are the length of the active set, the work, and what is `fresh` and `hard`."""

    value: Raw
    eta: Raw  # (room + 1, m)
    inverse: Raw
    toward: Raw
    active: NDArray[Any]
    side: NDArray[Any]
    counts: NDArray[Any]
    tolerance: Raw  # (1,)


@compiled
def _at(s: QpSearch) -> Any:
    return s.eta[s.counts[LENGTH]]


@compiled
def _column(q: QpProblem, s: QpSearch, row: int) -> None:
    length, column, gram = s.counts[LENGTH], _at(s), q.gram[row]
    s.counts[WORK] += length + COLUMN
    for i in range(len(q.low)):
        column[i] = gram[i]
    for k in range(length):
        eta = s.eta[k]
        factor = eta[row] * s.inverse[k]
        for i in range(len(q.low)):
            column[i] -= eta[i] * factor


@compiled
def _hard(q: QpProblem, row: int) -> bool:
    return row < q.moves or not (q.softness[row - q.moves] > 0)


@compiled
def _store(q: QpProblem, s: QpSearch, row: int, toward: Any) -> None:
    length, eta = s.counts[LENGTH], _at(s)
    pivot = eta[row]
    s.inverse[length] = q.one / pivot
    eta[row] = pivot - q.one
    s.toward[length] = toward
    s.active[length] = row
    s.counts[LENGTH] = length + 1


@compiled
def _leave(q: QpProblem, s: QpSearch, place: int) -> None:
    row, last, column = s.active[place], s.counts[LENGTH] - 1, _at(s)
    s.value[row] = q.high[row] if s.side[row] > 0 else q.low[row]
    s.side[row] = 0
    s.counts[LENGTH] = last
    if q.moves and _hard(q, row):
        s.counts[HARD] -= 1
    s.counts[WORK] += COLUMN + 2 * (last - place)
    out, rest = s.eta[place], q.one / s.inverse[place]
    for k in range(place + 1, last + 1):
        eta, at = s.eta[k], s.active[k]
        held, taken = eta[row], out[at]
        pivot = q.one / s.inverse[k] + taken * held
        inverse = q.one / pivot
        share = taken * inverse
        for i in range(len(q.low)):
            old = out[i]
            out[i] = eta[i] + old * held
            eta[i] = old - out[i] * share
        out[at] = pivot - q.one
        eta[at] = share
        out[row] = held * rest
        rest -= out[row] * share
        s.inverse[k - 1] = inverse
        s.toward[k - 1] = s.toward[k]
        s.active[k - 1] = at
        out = eta
    factor = column[row]
    for i in range(len(q.low)):
        out[i] = column[i] + out[i] * factor
    out[row] = factor * rest


@compiled
def _most_violated(q: QpProblem, s: QpSearch, most: Any) -> int:
    """Return the row outside the active set that is violated by most, -1 where none is by more than `most`."""
    row = -1
    for i in range(len(q.low)):
        if s.side[i] == 0:
            over, under = s.value[i] - q.high[i], q.low[i] - s.value[i]
            excess = over if over > under else under
            if excess > most:
                most = excess
                row = i
    return row


@compiled
def _move(q: QpProblem, s: QpSearch, moved: Any) -> None:
    column = _at(s)
    for i in range(len(q.low)):
        s.value[i] -= column[i] * moved


@compiled
def _free(q: QpProblem, s: QpSearch, row: int) -> bool:
    filled = q.moves > 0 and s.counts[HARD] == q.moves and _hard(q, row)
    return _at(s)[row] > q.least and s.counts[LENGTH] < q.room and not filled


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
    column = _at(s)
    for i in range(q.moves):
        value = q.slope[0, i] * parameters[0]
        for j in range(1, len(parameters)):
            value += q.slope[j, i] * parameters[j]
        for k in range(s.counts[LENGTH]):
            at = s.active[k]
            value -= q.gram[at, i] * s.value[at]
        column[i] = value
    for i in range(q.moves, len(q.low)):
        value = _beyond(q, i - q.moves, parameters, column)
        if s.side[i] != 0:
            value -= q.softness[i - q.moves] * s.value[i]
        column[i] = value - _held(q, s, i)
    for i in range(q.moves):
        column[i] -= _held(q, s, i)


@compiled
def _refine(q: QpProblem, s: QpSearch, parameters: Raw) -> tuple[int, int]:
    """Return whether every move is near and keeps the hard rows that are active, and the row to enter next."""
    s.counts[WORK] += 2 * s.counts[LENGTH] + q.moves + COLUMN
    _residual(q, s, parameters)
    column = _at(s)
    for k in range(s.counts[LENGTH]):
        eta = s.eta[k]
        held = column[s.active[k]] * s.inverse[k]
        for i in range(len(q.low)):
            column[i] -= eta[i] * held
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
        elif _hard(q, i):
            missed = value - _held(q, s, i)
            if not (missed < q.kept and missed > -q.kept):
                near = 0
    return near, _most_violated(q, s, q.tolerance)


@compiled
def _step(q: QpProblem, s: QpSearch, gap: Any, row: int, sign: Any) -> tuple[Any, int]:
    column = _at(s)
    step, place = (gap * sign / column[row] if _free(q, s, row) else q.far), -1
    for k in range(s.counts[LENGTH]):
        held = s.active[k]
        toward = s.toward[k]
        rate = column[held] * (sign * toward)
        if rate > q.least:
            ratio = s.value[held] * toward / rate
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
    _column(q, s, row)
    if q.moves and not s.counts[FRESH] and not _free(q, s, row):
        s.counts[FRESH], following = _refine(q, s, parameters)
        return (SOLVED if s.counts[WORK] < q.budget else CAPPED), following
    while s.counts[WORK] < q.budget:
        step, place = _step(q, s, s.value[row] - limit, row, sign)
        if step >= q.far:
            return INFEASIBLE, row
        multiplier += step * sign
        _move(q, s, step * sign)
        if place < 0:
            if q.moves:
                noise = multiplier * sign * q.noise
                s.tolerance[0] = noise if noise > s.tolerance[0] else s.tolerance[0]
                s.counts[FRESH] = 0
                s.counts[HARD] += 1 if _hard(q, row) else 0
            s.side[row] = 1 if above else -1
            following = _most_violated(q, s, s.tolerance[0])
            s.value[row] = multiplier
            _store(q, s, row, sign)
            return SOLVED, following
        _leave(q, s, place)
    return CAPPED, row


@compiled
def _believed(q: QpProblem, s: QpSearch) -> int:
    for k in range(s.counts[LENGTH]):
        if q.kept < q.far and not (s.value[s.active[k]] * s.toward[k] * q.noise < q.kept):
            return CAPPED
    return SOLVED


@compiled
def _search(q: QpProblem, s: QpSearch, row: int, parameters: Raw) -> int:
    for i in range(len(s.counts)):
        s.counts[i] = 0
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


@numba.njit(cache=True, error_model="numpy")
def search_all(q: QpProblem, s: QpSearch, parameters: Raw, moves: Raw, status: Raw, work: Raw, side: Raw) -> None:
    """Search for every row of `parameters` (lanes, p); fill `moves`, not yet scaled, and what the searches did."""
    for lane in range(len(parameters)):
        own = parameters[lane]
        for i in range(len(q.low)):
            value = q.slope[0, i] * own[0]
            for j in range(1, len(own)):
                value += q.slope[j, i] * own[j]
            s.value[i] = value
            s.side[i] = 0
        row = _most_violated(q, s, q.tolerance)
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

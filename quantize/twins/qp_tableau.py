"""Keep the tableau of the multipliers and all rows: the twin of fl_qp_tableau.h, bit for bit.

Whole slices are not assigned: what numba takes for their errors compiles longer than all the rest.
"""

from __future__ import annotations

from typing import Any

from firmloop.design.outcome import COLUMN
from firmloop.quantize.twins.qp_memory import (
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
def _at(s: QpSearch) -> Any:
    return s.eta[s.counts[LENGTH]]


@compiled
def begin(q: QpProblem, s: QpSearch, row: int) -> None:
    """Take the column of the row that enters."""
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
def _store(q: QpProblem, s: QpSearch, row: int, toward: Any) -> None:
    length, eta = s.counts[LENGTH], _at(s)
    pivot = eta[row]
    s.inverse[length] = q.one / pivot
    eta[row] = pivot - q.one
    s.toward[length] = toward
    s.active[length] = row
    s.counts[LENGTH] = length + 1


@compiled
def leave(q: QpProblem, s: QpSearch, place: int) -> None:
    """Take the row at `place` out of the active set, out of every eta after its own, and out of the column."""
    row, last, column = s.active[place], s.counts[LENGTH] - 1, _at(s)
    s.value[row] = q.high[row] if s.side[row] > 0 else q.low[row]
    s.side[row] = 0
    s.counts[LENGTH] = last
    if q.moves and is_hard(q, row):
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
def go(q: QpProblem, s: QpSearch, moved: Any) -> None:
    """Go `moved` along the column."""
    column = _at(s)
    for i in range(len(q.low)):
        s.value[i] -= column[i] * moved


@compiled
def join(q: QpProblem, s: QpSearch, row: int, moved: Any, multiplier: Any, toward: Any) -> int:
    """Put `row` into the active set; return the next row to enter, -1 for none."""
    go(q, s, moved)
    following = most_violated(q, s, s.tolerance[0])
    s.value[row] = multiplier
    _store(q, s, row, toward)
    return int(following)


@compiled
def correct(q: QpProblem, s: QpSearch, column: Raw) -> None:
    """Turn a residual of the rows into what multipliers and values lack."""
    for k in range(s.counts[LENGTH]):
        eta = s.eta[k]
        held = column[s.active[k]] * s.inverse[k]
        for i in range(len(q.low)):
            column[i] -= eta[i] * held

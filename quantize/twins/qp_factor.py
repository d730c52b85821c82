"""Keep a factor of the active rows alone, gram = L D L': the twin of fl_qp_factor.h, bit for bit.

The tableau of a program with many rows takes room times rows numbers; the factor takes half of room squared, and the
rows follow from the gram, once for each one that enters. See `fl_qp_factor.h` for the method.
"""

from __future__ import annotations

from typing import Any

from firmloop.design.outcome import COLUMN
from firmloop.quantize.twins.qp_memory import LENGTH, WORK, QpProblem, QpSearch, Raw, compiled, most_violated

REACHED, PIVOT = range(2)  # places of `QpSearch.own`


@compiled
def _line(k: int) -> int:
    """Return where row k of L begins."""
    return k * (k - 1) // 2


@compiled
def _forward(s: QpSearch, own: Raw, first: int, to: int) -> None:
    value, line = own[first + to], _line(to)
    for j in range(to):
        value -= s.lower[line + j] * own[first + j]
    own[first + to] = value


@compiled
def _back(s: QpSearch) -> None:
    for k in range(s.counts[LENGTH] - 1, 0, -1):
        own, line = s.rate[k], _line(k)
        for j in range(k):
            s.rate[j] -= s.lower[line + j] * own


@compiled
def _rates(q: QpProblem, s: QpSearch, row: int) -> None:
    length, gram = s.counts[LENGTH], q.gram[row]
    own, pivot = _line(length), gram[row]
    for k in range(length):
        s.lower[own + k] = gram[s.active[k]]
        _forward(s, s.lower, own, k)
    for k in range(length):
        rate = s.lower[own + k] * s.inverse[k]
        pivot -= s.lower[own + k] * rate
        s.lower[own + k] = rate
        s.rate[k] = rate
    s.own[PIVOT] = pivot
    _back(s)


@compiled
def begin(q: QpProblem, s: QpSearch, row: int) -> None:
    """Begin to let `row` enter."""
    s.counts[WORK] += s.counts[LENGTH] + COLUMN
    _rates(q, s, row)
    s.own[REACHED] = s.value[row]


@compiled
def go(s: QpSearch, moved: Any) -> None:
    """Go `moved` along the rates."""
    s.own[REACHED] -= s.own[PIVOT] * moved
    for k in range(s.counts[LENGTH]):
        s.multiplier[k] -= s.rate[k] * moved


@compiled
def join(q: QpProblem, s: QpSearch, row: int, moved: Any, multiplier: Any, toward: Any) -> int:
    """Put `row` into the active set; return the next row to enter, -1 for none."""
    last = s.counts[LENGTH]
    go(s, moved)
    s.inverse[last] = q.one / s.own[PIVOT]
    s.multiplier[last] = multiplier
    s.toward[last] = toward
    s.active[last] = row
    s.counts[LENGTH] = last + 1
    for i in range(len(q.low)):
        s.value[i] = s.start[i]
    for k in range(last + 1):
        gram, by = q.gram[s.active[k]], s.multiplier[k]
        for i in range(len(q.low)):
            s.value[i] -= gram[i] * by
    return int(most_violated(q, s, s.tolerance[0]))


@compiled
def _without(q: QpProblem, s: QpSearch, place: int) -> None:
    length = s.counts[LENGTH]
    rest = q.one / s.inverse[place]
    for k in range(place + 1, length):
        line, to = _line(k), _line(k - 1)
        left = s.lower[line + place]
        for j in range(place):
            s.lower[to + j] = s.lower[line + j]
        for j in range(place + 1, k):
            left -= s.along[j] * s.lower[line + j]
            s.lower[to + j - 1] = s.lower[line + j] + s.share[j] * left
        old, part = q.one / s.inverse[k], rest * left
        inverse = q.one / (old + part * left)
        s.along[k] = left
        s.share[k] = part * inverse
        rest = rest * (old * inverse)
        s.inverse[k - 1] = inverse
        s.active[k - 1] = s.active[k]
        s.toward[k - 1] = s.toward[k]
        s.multiplier[k - 1] = s.multiplier[k]
    s.counts[LENGTH] = length - 1


@compiled
def leave(q: QpProblem, s: QpSearch, place: int, entering: int) -> None:
    """Take the row at `place` out of the active set, while `entering` is on its way in."""
    s.side[s.active[place]] = 0
    s.counts[WORK] += (s.counts[LENGTH] + COLUMN) // 2
    _without(q, s, place)
    _rates(q, s, entering)

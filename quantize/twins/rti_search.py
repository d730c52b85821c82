"""A quadratic program in the rows of its limits, for many lanes at once: the twin of fl_rti_search.h, bit for bit.

    min 1/2 v'Hv + g'v,   low <= G v <= high,   H = L D L'

The rows y = y0 - T m of the limits stand against their multipliers m, T = G H^-1 G'. The most violated row enters the
active set; rows whose multiplier would change its sign on the way leave (Goldfarb and Idnani, Mathematical Programming
27, 1983). Each exchange is a pivot of the tableau T (principal pivoting: Cottle, Pang and Stone, The Linear
Complementarity Problem, 1992), which is small here and different in every sample.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from firmloop.quantize.twins.rti_course import CAPPED, FAR, INFEASIBLE, Raw, RtiCourse, add_up


class RtiSearch:
    """The quadratic program of one iteration in the rows of its limits: `value` is y, or m of an active row."""

    def __init__(self, course: RtiCourse, limits: Raw, plan: Raw, g: Raw, factor: Raw, inverse: Raw) -> None:
        """Take G, the plan's moves and limited states, g, L and 1/D of H = L D L', a lane each."""
        own, lanes, kind = course, len(g), g.dtype.type
        self.own, self.kind = own, kind
        size, rows, m = own.unknowns, own.rows, len(own.r)
        self.first = np.concatenate([np.arange(size), np.zeros(rows - size, np.int64)])
        limited = own.length * [own.weight[m:]]
        self.weight = np.concatenate([np.tile(own.weight[:m], own.length), *limited])
        ends = [
            np.concatenate([np.tile(end[:m], own.length), np.tile(end[m:], own.length)]) for end in (own.low, own.high)
        ]
        self.low, self.high = ends[0] - plan, ends[1] - plan
        self.v = np.zeros_like(limits)  # L^-1 G'
        right = -g
        for j in range(size):
            kept = np.arange(j) >= self.first[:, None]  # before, there is nothing yet
            taken = np.where(kept, -(factor[:, j, None, :j] * self.v[:, :, :j]), self.kind(0))
            self.v[:, :, j] = add_up(limits[:, :, j], taken)
            right[:, j] = add_up(right[:, j], -(factor[:, j, :j] * right[:, :j]))
        self.inverse = inverse
        kept = np.arange(size) >= self.first[:, None]
        terms = np.where(kept, self.v * (right * inverse)[:, None], self.kind(0))
        self.value = add_up(np.zeros((lanes, rows), g.dtype), terms)
        self.free = self.value[:, :size].copy()
        self.side = np.zeros((lanes, rows), np.int64)

    def run(self, factored: NDArray[np.bool_]) -> NDArray[np.int64]:
        """Let violated rows enter until none is left; return the status (lanes,)."""
        status = np.zeros(len(self.value), np.int64)
        entering, excess = self._select(np.arange(len(status)))
        lanes = np.flatnonzero(factored & (excess > self.own.tolerance))
        if not len(lanes):
            return status
        self._tableau(lanes)
        row, work = entering[lanes], np.zeros(len(lanes), np.int64)
        place = np.arange(len(lanes))  # of a lane in the tableau
        limit, toward, multiplier = self._entered(lanes, row)
        while len(lanes):
            column = self.t[place, :, row]
            pivot, value = column[np.arange(len(row)), row], self.value[lanes]
            step = (value[np.arange(len(row)), row] - limit) * toward / pivot
            step = np.where(pivot > self.least[place, row], step, self.kind(FAR))
            held = self.side[lanes].astype(value.dtype)
            rate = column * (toward[:, None] * held)
            ratio = np.where((held != 0) & (rate > 0), value * held / rate, self.kind(FAR))
            ratio = np.where(ratio < self.kind(FAR), ratio, self.kind(FAR))
            leaving = ratio.argmin(axis=1)
            nearest = ratio[np.arange(len(row)), leaving]
            leaves = nearest < step
            step = np.where(leaves, nearest, step)
            going = step < FAR
            status[lanes[~going]] = INFEASIBLE
            moved = step * toward
            multiplier = multiplier + moved
            self.value[lanes[going]] = (value - column * moved[:, None])[going]
            turned = np.where(leaves, leaving, row)
            above = self.side[lanes, turned] > 0
            ends = np.where(above, self.high[lanes, turned], self.low[lanes, turned])
            self.value[lanes, turned] = np.where(leaves, ends, multiplier)
            self.side[lanes, turned] = np.where(leaves, 0, toward.astype(np.int64))
            self._pivot(place[going], turned[going])
            work = work + 1
            selected, excess = self._select(lanes)
            done = ~leaves & ~(excess > self.own.tolerance)
            capped = going & ~done & (work >= self.own.budget)
            status[lanes[capped]] = CAPPED
            next_row = np.where(leaves, row, selected)
            fresh = self._entered(lanes, next_row)
            limit, toward, multiplier = (
                np.where(leaves, old, new) for old, new in zip((limit, toward, multiplier), fresh, strict=True)
            )
            stays = going & ~done & ~capped
            lanes, place, row, work = lanes[stays], place[stays], next_row[stays], work[stays]
            limit, toward, multiplier = limit[stays], toward[stays], multiplier[stays]
        return status

    def _entered(self, lanes: NDArray[np.int64], row: NDArray[np.int64]) -> tuple[Raw, Raw, Raw]:
        """Return the limit that a row violates, the side it is on, and its multiplier, zero."""
        above = self.value[lanes, row] > self.high[lanes, row]
        limit = np.where(above, self.high[lanes, row], self.low[lanes, row])
        return limit, np.where(above, self.kind(1), self.kind(-1)), np.zeros(len(lanes), self.value.dtype)

    def _select(self, lanes: NDArray[np.int64]) -> tuple[NDArray[np.int64], Raw]:
        """Find the most violated row outside the active set and its excess, in its span."""
        value, low, high = self.value[lanes], self.low[lanes], self.high[lanes]
        over, under = value - high, low - value
        excess = np.where(over > under, over, under) * self.weight
        excess = np.where(self.side[lanes] == 0, np.fmax(excess, self.kind(-1)), self.kind(-1))
        row = excess.argmax(axis=1)
        return row, excess[np.arange(len(lanes)), row]

    def _tableau(self, lanes: NDArray[np.int64]) -> None:
        """T = V D^-1 V', below the diagonal and mirrored."""
        v = self.v[lanes]
        scaled = v * self.inverse[lanes][:, None]
        t = np.zeros((len(lanes), v.shape[1], v.shape[1]), v.dtype)
        for j in range(v.shape[2]):
            kept = self.first <= j
            product = v[:, :, None, j] * scaled[:, None, :, j]
            t = t + np.where(kept[:, None] & kept, product, self.kind(0))
        self.t = np.tril(t) + np.tril(t, -1).swapaxes(1, 2)
        self.least = self.kind(self.own.least) * np.diagonal(self.t, axis1=1, axis2=2)

    def _pivot(self, place: NDArray[np.int64], row: NDArray[np.int64]) -> None:
        """Exchange the multiplier and the value of a row."""
        which = np.arange(len(place))
        t = self.t[place]
        inverse = self.kind(1) / t[which, row, row]
        across, column = t[which, row] * inverse[:, None], t[which, :, row]
        t = t - column[:, :, None] * across[:, None]
        t[which, row] = across
        t[which, :, row] = -(column * inverse[:, None])
        t[which, row, row] = inverse
        self.t[place] = t

    def moves(self) -> Raw:
        """Return the step of every move; an active one ends at its limit."""
        size = self.own.unknowns
        ends = np.where(self.side > 0, self.high, self.low)
        return np.where(self.side != 0, ends, self.value)[:, :size]

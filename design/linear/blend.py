"""Blend linear controllers, one for each point of a signal, into one law.

With s the signal `schedule_on`, v_i what the controller of `points[i]` puts out before it is limited::

    t_i = min(max((s - points[i]) / (points[i+1] - points[i]), 0), 1)
    v   = v_0 + sum_i t_i (v_(i+1) - v_i),        u = min(max(v, u_min), u_max)

Each controller keeps its own state and runs in every sample, on the inputs and, an observer, on the u that is applied;
controllers whose state moves by the same numbers share one state, and are then what interpolated output matrices are.
So v is continuous in s, whatever the states are: the transfer is bumpless. And s moves no state, so that the range of
each is that of a linear system driven by its inputs; interpolated state matrices would allow no such proof (a mean of
two stable matrices may be unstable).

Integral action (an output's integral, such as that of state feedback) is one state for all of them, kept in the
output's unit, with e_i the step that controller i would move it by::

    v   as above, plus I,       e = e_0 + sum_i t_i (e_(i+1) - e_i)
    I+ = I + e, unless v is beyond a limit and e points further out
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np
import numpy.typing as npt

from firmloop.design.design import Request
from firmloop.design.draft import Draft
from firmloop.design.law import DesignError, Law
from firmloop.design.linear.linear_law import (
    INTEGRAL_WHY,
    after_limit,
    check_names,
    slopes,
    state_ranges,
    symbols,
    write,
)
from firmloop.design.linear.reach import widened
from firmloop.identify.signal import Signal

Array = npt.NDArray[np.float64]
Named = dict[str, tuple[str, ca.SX]]
Ranges = list[tuple[Signal, str]]


@dataclass(frozen=True, slots=True)
class Schedule:
    """The signal that the points are values of, rising, and the wires that each controller has."""

    signal: Signal
    at: tuple[float, ...]
    loop: tuple[Signal, ...]


@dataclass(frozen=True, slots=True)
class _Placed:
    """One controller of the schedule, over the symbols of the law; `own`: nobody before it keeps its state."""

    draft: Draft
    ranges: Ranges
    own: bool


def shares(s: ca.SX, at: Sequence[float], named: Named) -> list[ca.SX]:
    """Return t_i for every gap between two points."""
    found = []
    for k, (one, other) in enumerate(itertools.pairwise(at), 1):
        if math.isinf(1 / (other - one)):
            raise DesignError(
                f"controller.points {one:g} and {other:g} are so near to each other that nothing is between them; "
                "move one of them"
            )
        share = ca.fmin(ca.fmax((s - one) * (1 / (other - one)), 0), 1)
        named[f"share_{k}"] = ("1", share)
        found.append(share)
    return found


def mixed(values: Sequence[ca.SX], given: Sequence[ca.SX]) -> ca.SX:
    """Return the blend of `values`; nothing is written between two that are the same."""
    total = values[0]
    for share, (one, other) in zip(given, itertools.pairwise(values), strict=True):
        if not ca.is_equal(one, other, 100):
            total = total + (other - one) * share
    return total


def blended(
    request: Request,
    schedule: Schedule,
    drafts: Sequence[Draft],
    says: str,
    low: Sequence[float],
    high: Sequence[float],
) -> Law:
    """Write the law of the module docstring; `low` and `high` limit the outputs."""
    z = dict(zip((w.name for w in request.inputs), symbols([w.name for w in request.inputs]), strict=True))
    named: Named = {}
    given = shares(z[schedule.signal.name], schedule.at, named)
    placed = _placed(
        replace(request, inputs=schedule.loop), [z[wire.name] for wire in schedule.loop], drafts, low, high
    )
    for k, each in enumerate(placed, 1):
        named |= _names(request, each, placed, k)
    free = [mixed(list(values), given) for values in zip(*(each.draft.outputs for each in placed), strict=True)]
    steps = [each.draft.step for each in placed]
    integral = ca.SX.sym("integral")
    if any(step is not None for step in steps):
        free = [free[0] + integral]
    limited = [ca.fmin(ca.fmax(v, least), most) for v, least, most in zip(free, low, high, strict=True)]
    ends = ["unlimited"] if len(free) == 1 else [f"{wire.name}_unlimited" for wire in request.outputs]
    named |= {end: (wire.unit, v) for end, wire, v in zip(ends, request.outputs, free, strict=True)}
    state: list[tuple[ca.SX, ca.SX]] = []
    ranges: Ranges = []
    for each in (each for each in placed if each.own):
        nexts = [after_limit(element, element.next) for element in each.draft.state]
        if each.draft.applied:
            nexts = ca.substitute(nexts, list(each.draft.applied), limited)
        state += zip((element.symbol for element in each.draft.state), nexts, strict=True)
        ranges += each.ranges
    if any(step is not None for step in steps):
        step = mixed([ca.SX(0) if one is None else one for one in steps], given)
        named["integral_step"] = (request.outputs[0].unit, step)
        out = ca.logic_or(ca.logic_and(free[0] > high[0], step > 0), ca.logic_and(free[0] < low[0], step < 0))
        state.append((integral, integral + ca.if_else(ca.logic_not(out), step, 0)))
        ranges.append(_integral_range(schedule, placed, request.outputs[0].unit, low[0], high[0]))
    check_names(request, [*(symbol.name() for symbol, _ in state), *named])
    after, limited, free, values = _shared(
        [value for _, value in state], limited, free, [value for _, value in named.values()]
    )
    law = write(
        request,
        says,
        list(z.values()),
        list(zip((symbol for symbol, _ in state), after, strict=True)),
        ranges,
        list(zip(limited, free, strict=True)),
        dict(zip(named, zip((unit for unit, _ in named.values()), values, strict=True), strict=True)),
    )
    return replace(law, rest=_rest(request, schedule), states=_states(request, schedule, drafts))


def _placed(
    loop: Request, z: Sequence[ca.SX], drafts: Sequence[Draft], low: Sequence[float], high: Sequence[float]
) -> list[_Placed]:
    """Write every draft in the symbols of the law; the state of an earlier one serves where it moves alike."""
    found: list[_Placed] = []
    numbered = any(not _alike(drafts[0], draft) for draft in drafts[1:])
    for k, draft in enumerate(drafts, 1):
        before = next((other for other, given in zip(found, drafts, strict=False) if _alike(given, draft)), None)
        if before is None:
            names = [f"{element.name}_p{k}" if numbered else element.name for element in draft.state]
            own = symbols(names)
            try:
                proven = state_ranges(loop, draft, low, high)
            except DesignError as error:
                raise DesignError(f"point {k} of the gain_schedule: {error}") from None
            ranges = [(replace(signal, name=name), why) for name, (signal, why) in zip(names, proven, strict=True)]
        else:
            own, ranges = tuple(element.symbol for element in before.draft.state), before.ranges
        old = [*draft.inputs, *(element.symbol for element in draft.state)]
        nexts, outputs = ([element.next for element in draft.state], list(draft.outputs))
        extra = [*(value for _, value in draft.named.values()), *([] if draft.step is None else [draft.step])]
        moved = ca.substitute([*nexts, *outputs, *extra], old, [*z, *own])
        values = iter(moved)
        state = tuple(
            replace(element, name=symbol.name(), symbol=symbol, next=next(values))
            for element, symbol in zip(draft.state, own, strict=True)
        )
        outputs = [next(values) for _ in outputs]
        named = {name: (unit, next(values)) for name, (unit, _) in draft.named.items()}
        step = None if draft.step is None else next(values)
        written = replace(draft, inputs=tuple(z), state=state, outputs=tuple(outputs), named=named, step=step)
        found.append(_Placed(written, ranges, before is None))
    return found


def _alike(one: Draft, other: Draft) -> bool:
    """Tell whether two drafts move their state by the same numbers."""
    if [(e.name, e.low, e.high) for e in one.state] != [(e.name, e.low, e.high) for e in other.state]:
        return False
    if len(one.applied) != len(other.applied):
        return False
    a, b = slopes(one), slopes(other)
    return np.array_equal(a.a, b.a) and np.array_equal(a.b, b.b)


def _names(request: Request, each: _Placed, placed: Sequence[_Placed], k: int) -> Named:
    """Name what controller `k` puts out, and its own values: with its number where another has a different one."""
    several = len(request.outputs) > 1
    found: Named = {
        (f"{wire.name}_point_{k}" if several else f"point_{k}"): (wire.unit, value)
        for wire, value in zip(request.outputs, each.draft.outputs, strict=True)
    }
    for name, (unit, value) in each.draft.named.items():
        if any(ca.is_equal(value, output, 100) for output in each.draft.outputs):
            continue
        rivals = [other.draft.named[name][1] for other in placed if name in other.draft.named]
        same = all(ca.is_equal(value, rival, 100) for rival in rivals)
        found[name if same else f"{name}_p{k}"] = (unit, value)
    return found


def _integral_range(
    schedule: Schedule, placed: Sequence[_Placed], unit: str, low: float, high: float
) -> tuple[Signal, str]:
    """I grows only while v <= u_max: then I <= u_max less the least that a controller puts out, and one step more."""
    rests = [_span(each, schedule, each.draft.outputs[0]) for each in placed]
    steps = [(0.0, 0.0) if (one := each.draft.step) is None else _span(each, schedule, one) for each in placed]
    least = min(0.0, low - max(top for _, top in rests) + min(0.0, *(bottom for bottom, _ in steps)))
    most = max(0.0, high - min(bottom for bottom, _ in rests) + max(0.0, *(top for _, top in steps)))
    return widened("integral", unit, least, most), INTEGRAL_WHY


def _span(each: _Placed, schedule: Schedule, value: ca.SX) -> tuple[float, float]:
    """Return the ends of a linear value while inputs and state keep their ranges."""
    x = [*(element.symbol for element in each.draft.state), *each.draft.inputs]
    ranges = [*(signal for signal, _ in each.ranges), *schedule.loop]
    weights = np.array(ca.densify(ca.evalf(ca.jacobian(value, ca.vertcat(*x)))), dtype=np.float64).ravel()
    ends = [sorted((w * s.low, w * s.high)) for w, s in zip(weights, ranges, strict=True) if w != 0]
    return math.fsum(low for low, _ in ends), math.fsum(high for _, high in ends)


def _shared(*rows: Sequence[ca.SX]) -> list[list[ca.SX]]:
    """Write what is equal once, so that it is computed once."""
    found = iter(ca.cse([value for row in rows for value in row]))
    return [[next(found) for _ in row] for row in rows]


def _rest(request: Request, schedule: Schedule) -> tuple[float, ...]:
    """Return what the inputs stand at on paper: the signal in the middle of its range, unless it closes the loop."""
    signal = schedule.signal
    middle = {} if signal in schedule.loop else {signal.name: (signal.low + signal.high) / 2}
    return tuple(middle.get(wire.name, min(max(0.0, wire.low), wire.high)) for wire in request.inputs)


def _states(request: Request, schedule: Schedule, drafts: Sequence[Draft]) -> tuple[int, ...]:
    """Return the places, among the inputs of the law, of those that carry the plant's states."""
    names = [wire.name for wire in request.inputs]
    return tuple(names.index(schedule.loop[k].name) for k in drafts[0].states)

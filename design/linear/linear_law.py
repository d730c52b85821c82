"""Write a linear law whose outputs are limited, and prove the range of its state."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np
import numpy.typing as npt

from firmloop.design.design import Design, Request
from firmloop.design.draft import Draft, Element
from firmloop.design.law import DesignError, Flag, Law, Scalar
from firmloop.design.linear.reach import WIDER, forgets, reach, rounding_share, widened
from firmloop.design.table import limits
from firmloop.identify.signal import Signal

Array = npt.NDArray[np.float64]

MOST_STATES = 64  # of which the proof takes a second
L1_WHY = "L1 norm of the impulse response from all inputs at the ends of their ranges"
LIMIT_WHY = "limited to x_min and x_max"
SLOW_WHY = "no bound: a pole so near to the unit circle that roundings may add up"
CIRCLE_WHY = "no bound: a pole on the unit circle keeps what it is given"
INTEGRAL_WHY = "it moves outward only while the unlimited output is within its limits, at most one step beyond"


@dataclass(frozen=True, slots=True)
class Slopes:
    """x+ = a x + b d of a draft's state x, with d its inputs and, behind them, what is applied."""

    a: Array  # (n, n)
    b: Array  # (n, m)


def designed(request: Request, draft: Draft) -> Design:
    """Limit the outputs to the table's `u_min` and `u_max`."""
    return Design(limited_law(request, draft, *limits(request.table, request.outputs)), draft.figures, None, {})


def limited_law(request: Request, draft: Draft, low: Sequence[float], high: Sequence[float]) -> Law:
    """Limit each output to its `low` and `high`, and put a range to each state variable."""
    outputs = [ca.fmin(ca.fmax(free, least), most) for free, least, most in zip(draft.outputs, low, high, strict=True)]
    ranges = state_ranges(request, draft, low, high)
    nexts = [after_limit(element, element.next) for element in draft.state]
    check_names(request, [*(element.name for element in draft.state), *draft.named])
    return write(
        request,
        draft.says,
        draft.inputs,
        [(element.symbol, after) for element, after in zip(draft.state, nexts, strict=True)],
        ranges,
        list(zip(outputs, draft.outputs, strict=True)),
        draft.named,
    )


def write(
    request: Request,
    says: str,
    inputs: Sequence[ca.SX],
    state: Sequence[tuple[ca.SX, ca.SX]],
    ranges: Sequence[tuple[Signal, str]],
    outputs: Sequence[tuple[ca.SX, ca.SX]],
    named: Mapping[str, tuple[str, ca.SX]],
) -> Law:
    """Write a law that starts at zero.

    `state` holds (symbol, next), `ranges` its signal and the argument for it, `outputs` (limited, unlimited).
    """
    flag = ca.SX(0)
    for limited, free in outputs:
        flag = ca.logic_or(flag, limited != free) if flag.is_symbolic() or not flag.is_zero() else limited != free
    stage = ca.Function(
        "law",
        [ca.vertcat(*(symbol for symbol, _ in state)), ca.vertcat(*inputs)],
        [
            ca.densify(ca.vertcat(*(after for _, after in state))),
            ca.densify(ca.vertcat(*(limited for limited, _ in outputs))),
            flag,
            ca.densify(ca.vertcat(*(value for _, value in named.values()))),
        ],
        ["x", "z"],
        ["x_next", "u", "flags", "named"],
    )
    flag_says = "the output stands at its limit" if len(outputs) == 1 else "an output stands at its limit"
    return Law(
        name=request.name,
        says=says,
        period=request.period,
        inputs=request.inputs,
        outputs=request.outputs,
        state=tuple(signal for signal, _ in ranges),
        start=tuple(min(max(0.0, signal.low), signal.high) for signal, _ in ranges),
        why=tuple(why for _, why in ranges),
        flags=(Flag("saturated", flag_says),),
        stages=(Scalar(stage, tuple(Signal(name, unit, -math.inf, math.inf) for name, (unit, _) in named.items())),),
    )


def weighted_sum(weights: Sequence[float], terms: Sequence[ca.SX]) -> ca.SX:
    """Sum weight times term in order; nothing is written for a weight of 0, nor a product for 1 and -1."""
    total = ca.SX(0)
    for weight, term in zip(weights, terms, strict=True):
        if weight == 0:
            continue
        total = total - term if weight == -1 else total + (term if weight == 1 else float(weight) * term)
    return total


def symbols(names: Sequence[str]) -> tuple[ca.SX, ...]:
    """Return one scalar symbol a name."""
    return tuple(ca.SX.sym(name) for name in names)


def check_names(request: Request, own: Sequence[str]) -> None:
    """Refuse a wire that is called like a value inside the law."""
    for wire in request.inputs + request.outputs:
        if wire.name in own:
            raise DesignError(
                f"signals.{wire.name} is also the name of a value inside the controller; rename the signal"
            )


def after_limit(element: Element, after: ca.SX) -> ca.SX:
    """Limit what a state variable is next, where it has limits."""
    return ca.fmin(ca.fmax(after, element.low), element.high) if _limited(element) else after


def slopes(draft: Draft) -> Slopes:
    """Return the matrices of a draft's state."""
    if not draft.state:
        return Slopes(np.zeros((0, 0)), np.zeros((0, len(draft.inputs) + len(draft.applied))))
    x, d = ca.vertcat(*(element.symbol for element in draft.state)), ca.vertcat(*draft.inputs, *draft.applied)
    after = ca.densify(ca.vertcat(*(element.next for element in draft.state)))
    both = ca.Function("slopes", [x, d], [ca.densify(ca.jacobian(after, x)), ca.densify(ca.jacobian(after, d))])
    a, b = (np.array(part, dtype=np.float64) for part in both(0.0, 0.0))
    size = len(draft.state)
    return Slopes(a.reshape(size, size), b.reshape(size, len(draft.inputs) + len(draft.applied)))


def check_states(count: int, owner: str, cure: str) -> None:
    """Refuse more states than can be proven; DesignError that begins with their `owner` and ends with the `cure`."""
    if count > MOST_STATES:
        raise DesignError(f"{owner} {count} states; at most {MOST_STATES} can be proven in reasonable time: {cure}")


def state_ranges(
    request: Request, draft: Draft, u_low: Sequence[float], u_high: Sequence[float]
) -> list[tuple[Signal, str]]:
    """Prove the range of each state variable; limited ones, and what is applied, are inputs to the others."""
    check_states(
        len(draft.state),
        f"the law of controller.kind of '{request.name}' has",
        "lower its order, or split it into controllers in series",
    )
    found_slopes = slopes(draft)
    a, b = found_slopes.a, found_slopes.b
    applied = list(zip(u_low, u_high, strict=True)) if draft.applied else []
    ends = [*((wire.low, wire.high) for wire in request.inputs), *applied]
    held = np.array([_limited(element) for element in draft.state], dtype=bool)
    free = ~held
    inner = a[np.ix_(free, free)]
    forgetting = forgets(inner, f"the law of controller.kind of '{request.name}'")
    low = np.array([*(e.low for e in draft.state if _limited(e)), *(end for end, _ in ends)])
    high = np.array([*(e.high for e in draft.state if _limited(e)), *(end for _, end in ends)])
    drive = np.hstack([a[np.ix_(free, held)], b[free]])
    least, most = reach(inner, drive, low, high) if forgetting else (np.full(free.sum(), s) for s in (-np.inf, np.inf))
    share = WIDER
    if forgetting:
        spans, drives = np.maximum(np.abs(least), np.abs(most)), np.maximum(np.abs(low), np.abs(high))
        share = max(WIDER, rounding_share(inner, drive, spans, drives))
    endless = f"{SLOW_WHY if forgetting else CIRCLE_WHY}; {draft.remedy}"
    why = L1_WHY if forgetting and math.isfinite(share) else endless
    found: list[tuple[Signal, str]] = []
    bounds = iter(zip(least, most, strict=True))
    for element in draft.state:
        if _limited(element):
            found.append((Signal(element.name, element.unit, element.low, element.high), LIMIT_WHY))
            continue
        down, up = next(bounds)
        found.append((widened(element.name, element.unit, float(down), float(up), share), why))
    return found


def _limited(element: Element) -> bool:
    return math.isfinite(element.low) and math.isfinite(element.high)

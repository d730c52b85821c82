"""Write the difference equations of a PID, its factors constant or computed from a scheduling signal.

The equations stand in `pid.py`. A factor may be a number or an expression of the inputs: a gain schedule interpolates
factors, and every controller of the schedule shares one state.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import casadi as ca

from firmloop.design.design import Request
from firmloop.design.kinds.pid.ranges import Pid
from firmloop.design.law import Flag, Law, Scalar
from firmloop.design.linear.linear_law import check_names
from firmloop.design.models.anti_windup import Sample
from firmloop.design.models.feedforward import LAST, Feedforward
from firmloop.identify.signal import Signal

Factor = float | ca.SX


@dataclass(frozen=True, slots=True)
class Factors:
    """What the equations multiply by; `step` is ki h, `half_step` and the others as in `Pid`."""

    kp: Factor
    b: Factor
    c: Factor
    step: Factor
    half_step: Factor
    slope: Factor
    forget: Factor
    tracking: Factor
    u_min: Factor
    u_max: Factor


@dataclass(frozen=True, slots=True)
class Wires:
    """Which signal is what; the last four are named by the table, None where it does not."""

    reference: Signal
    measurement: Signal
    output: Signal
    manual: Signal | None = None  # what the output follows while `automatic` is below one half
    automatic: Signal | None = None
    tracking: Signal | None = None  # what the anti-windup compares v with, in place of u
    schedule: Signal | None = None


def factors(pid: Pid) -> Factors:
    """Return the factors of constant gains."""
    step = pid.ki * pid.period
    return Factors(
        *(pid.kp, pid.b, pid.c, step, pid.half_step, pid.slope, pid.forget, pid.tracking, pid.u_min, pid.u_max)
    )


def write(
    request: Request,
    says: str,
    pid: Pid,
    given: Factors,
    z: Mapping[str, ca.SX],
    wires: Wires,
    ranges: Sequence[tuple[Signal, str]],
    named: dict[str, tuple[str, ca.SX]],
    ahead: Feedforward | None,
) -> Law:
    """Write the law; `pid` tells which terms there are, `given` their factors, `z` the inputs by name."""
    state, why = tuple(signal for signal, _ in ranges), tuple(why for _, why in ranges)
    names = [signal.name for signal in state]
    x = {name: ca.SX.sym(name) for name in names}
    r, y = z[wires.reference.name], z[wires.measurement.name]
    error = r - y
    nexts: dict[str, ca.SX] = {}
    first = dict(x)
    free = _unlimited(pid, given, wires, x, r, y, error, nexts, first, named)
    if ahead is not None:
        free = _ahead(ahead, wires, x, r, z, free, nexts, first, named)
    wanted = free
    if wires.manual is not None and wires.automatic is not None:
        in_automatic = z[wires.automatic.name] > 0.5
        wanted = ca.if_else(in_automatic, free, z[wires.manual.name])
    limited, flag = _limited(pid, given, wanted, x, nexts)
    named["unlimited"] = (wires.output.unit, free)
    if pid.integrates:
        target = limited if wires.tracking is None else z[wires.tracking.name]
        following = _integral(pid, given, x["integral"], error, free, limited, target)
        if wires.automatic is not None:
            in_automatic = z[wires.automatic.name] > 0.5
            following = ca.if_else(in_automatic, following, x["integral"] + (limited - free))
        nexts["integral"] = following

    check_names(request, [*names, *named])
    arguments = [ca.vertcat(*x.values()), ca.vertcat(*(z[wire.name] for wire in request.inputs))]
    stage = ca.Function(
        "law",
        arguments,
        [
            ca.vertcat(*(nexts[name] for name in names)),
            limited,
            flag,
            ca.vertcat(*(value for _, value in named.values())),
        ],
        ["x", "z"],
        ["x_next", "u", "flags", "named"],
    )
    signals = tuple(Signal(name, unit, -math.inf, math.inf) for name, (unit, _) in named.items())
    return Law(
        name=request.name,
        says=says,
        period=request.period,
        inputs=request.inputs,
        outputs=request.outputs,
        state=state,
        start=tuple(min(max(0.0, signal.low), signal.high) for signal in state),
        why=why,
        flags=(Flag("saturated", "the output stands at its limit"),),
        stages=(Scalar(stage, signals),),
        rest=_rest(request, wires),
        first=ca.Function("first", arguments, [ca.vertcat(*first.values())]) if "started" in x else None,
        opening="started" if "started" in x else "",
    )


def _ahead(
    ahead: Feedforward,
    wires: Wires,
    x: Mapping[str, ca.SX],
    r: ca.SX,
    z: Mapping[str, ca.SX],
    free: ca.SX,
    nexts: dict[str, ca.SX],
    first: dict[str, ca.SX],
    named: dict[str, tuple[str, ca.SX]],
) -> ca.SX:
    """Return v with the feedforward in it, and note the reference where its speed is needed in the next sample."""
    speed = r
    if ahead.differentiates:
        speed = r - ca.if_else(x["started"] > 0.5, x[LAST], r)
        nexts |= {LAST: r, "started": ca.SX(1)}
        first |= {LAST: r, "started": ca.SX(1)}
    if ahead.parts:
        term = ahead.term(speed, z[ahead.position.name] if ahead.position is not None else None)
        named["feedforward"] = (wires.output.unit, term)
        free = free + term
    return ahead.with_dead_zone(free)


def _unlimited(
    pid: Pid,
    given: Factors,
    wires: Wires,
    x: Mapping[str, ca.SX],
    r: ca.SX,
    y: ca.SX,
    error: ca.SX,
    nexts: dict[str, ca.SX],
    first: dict[str, ca.SX],
    named: dict[str, tuple[str, ca.SX]],
) -> ca.SX:
    """Return v, put the derivative's next state into `nexts`, and into `first` what it is in the first sample."""
    # r - y is written once, so that it is computed once
    weighted_b = error if _is(given.b, 1.0) else given.b * r - y
    weighted_c = (
        error
        if _is(given.c, 1.0)
        else weighted_b
        if not isinstance(given.c, ca.SX) and _is(given.b, given.c)
        else given.c * r - y
    )
    terms: list[ca.SX] = []
    if pid.kp != 0:
        proportional = given.kp * weighted_b
        named["proportional"] = (wires.output.unit, proportional)
        terms.append(proportional)
    if pid.integrates:
        named["error"] = (wires.measurement.unit, error)
        terms.append(x["integral"] + given.half_step * error if pid.half_step else x["integral"])
    if pid.differentiates:
        behind = x["filtered" if "filtered" in x else "last"]
        held = ca.if_else(x["started"] > 0.5, behind, weighted_c)
        difference = weighted_c - held
        derivative = given.slope * difference
        if "derivative" in x:
            derivative = given.forget * x["derivative"] + derivative
            nexts["derivative"] = derivative
        nexts[behind.name()] = held + pid.follow * difference if pid.filters and "filtered" in x else weighted_c
        nexts["started"] = ca.SX(1)
        first |= {behind.name(): weighted_c, "started": ca.SX(1)}
        named["derivative_term"] = (wires.output.unit, derivative)
        terms.append(derivative)
    return sum(terms[1:], start=terms[0])


def _limited(
    pid: Pid, given: Factors, wanted: ca.SX, x: Mapping[str, ca.SX], nexts: dict[str, ca.SX]
) -> tuple[ca.SX, ca.SX]:
    """Return u and whether it is not what was wanted."""
    if not math.isfinite(pid.rate):
        limited = ca.fmin(ca.fmax(wanted, given.u_min), given.u_max)
        return limited, limited != wanted
    most = pid.rate * pid.period
    least, greatest = x["output_last"] - most, x["output_last"] + most
    # The range comes last: it holds whatever output_last is, and a limit that moves is kept at once.
    limited = ca.fmin(ca.fmax(ca.fmin(ca.fmax(wanted, least), greatest), given.u_min), given.u_max)
    nexts["output_last"] = limited
    return limited, limited != wanted


def _integral(
    pid: Pid, given: Factors, integral: ca.SX, error: ca.SX, free: ca.SX, limited: ca.SX, target: ca.SX
) -> ca.SX:
    """Return I[k+1] in automatic mode."""
    upward, downward = (error > 0, error < 0) if pid.ki > 0 else (error < 0, error > 0)
    above, below = (
        (free > given.u_max, free < given.u_min) if not math.isfinite(pid.rate) else (free > limited, free < limited)
    )
    back = given.tracking * (target - free)
    return pid.anti_windup.moved(Sample(integral, given.step * error, back, above, below, upward, downward))


def _rest(request: Request, wires: Wires) -> tuple[float, ...]:
    """Return what the inputs stand at on paper: automatic on, the scheduling signal in the middle of its range."""
    middle = {wires.schedule.name: (wires.schedule.low + wires.schedule.high) / 2} if wires.schedule else {}
    if wires.automatic is not None:
        middle[wires.automatic.name] = wires.automatic.high
    return tuple(middle.get(wire.name, min(max(0.0, wire.low), wire.high)) for wire in request.inputs)


def _is(factor: Factor, value: Factor) -> bool:
    return not isinstance(factor, ca.SX) and not isinstance(value, ca.SX) and factor == value

"""A PID whose kp, ki, kd, b, c, u_min and u_max can be set on the running target, within declared ranges.

The equations are those of `pid.py`, with ki h and kd/(tf+h) computed from the parameters in each sample. tf and tt stay
what they are: the controller cannot divide, so they follow the gains at the start where they are not given. The
integral is kept in the output's unit, ki inside, so that a change of ki moves nothing by itself.

The limits act at once. Each setter refuses what is beyond its own range; the range of u_min ends below that of u_max,
so that no pair that the setters take is out of order.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import replace

import casadi as ca

from firmloop.design.design import Request
from firmloop.design.kinds.pid.box import box_ranges, whole_pid
from firmloop.design.kinds.pid.equations import Wires, factors, write
from firmloop.design.kinds.pid.ranges import Pid
from firmloop.design.law import DesignError, Law
from firmloop.design.models.anti_windup import tracking_modes
from firmloop.design.models.feedforward import Feedforward
from firmloop.design.tunable import TunableParameter, held, read_parameters, with_parameters
from firmloop.identify.signal import Signal

LIMITS = ("u_min", "u_max")


def pid_parameters(
    table: Mapping[str, object], pid: Pid, units: Mapping[str, str], output: Signal, plain_gains: bool
) -> tuple[TunableParameter, ...]:
    """Read what of `pid` can be tuned; `plain_gains` where the form takes kp, ki and kd as they are."""
    defaults = {name: (units.get(name, "1"), float(getattr(pid, name))) for name in ("kp", "ki", "kd", "b", "c")}
    defaults |= {name: (output.unit, float(getattr(pid, name))) for name in LIMITS}
    quarter = (pid.u_max - pid.u_min) / 4
    usual = {"u_min": (pid.u_min, pid.u_min + quarter), "u_max": (pid.u_max - quarter, pid.u_max)}
    found = read_parameters(table, defaults, usual, "a pid")
    names = {parameter.signal.name: parameter.signal for parameter in found}
    _check_limits(names, pid, output)
    gains = [name for name in names if name not in LIMITS]
    if gains and not plain_gains:
        raise DesignError(
            f"controller.tunable = {gains} has no place in form = '{table['form']}', whose gains depend on each "
            "other; use form = 'parallel' with kp, ki and kd"
        )
    if "ki" in names and pid.anti_windup.tracks and not pid.tracking:
        raise DesignError("controller.tt_s is missing; ki can be tuned, so it cannot be chosen from ki = 0: give it")
    if "ki" in names and pid.anti_windup.one_sign and names["ki"].low * names["ki"].high < 0:
        raise DesignError(
            f"controller.ranges.ki = [{names['ki'].low:g}, {names['ki'].high:g}] holds both signs; "
            f"{pid.anti_windup} needs one: choose one, or anti_windup = {tracking_modes()}"
        )
    if "kd" in names and pid.kd == 0 and "tf_s" not in table:
        raise DesignError("controller.tf_s is missing; kd can be tuned, so it cannot be chosen from kd = 0: give it")
    return found


def _check_limits(names: Mapping[str, Signal], pid: Pid, output: Signal) -> None:
    """Assert that limits keep the output's range, and that no u_min that can be set reaches a u_max that can be."""
    for name in LIMITS:
        limit = names.get(name)
        if limit is not None and not output.low <= limit.low < limit.high <= output.high:
            raise DesignError(
                f"controller.ranges.{name} = [{limit.low:g}, {limit.high:g}] leaves signals.{output.name}, "
                f"{output.low:g} to {output.high:g} {output.unit}; narrow the range or widen the signal"
            )
    if not any(name in names for name in LIMITS):
        return
    highest = names["u_min"].high if "u_min" in names else pid.u_min
    lowest = names["u_max"].low if "u_max" in names else pid.u_max
    if not highest < lowest:
        raise DesignError(
            f"u_min can be set up to {highest:g} and u_max down to {lowest:g} {output.unit}; each setter knows its own "
            "range alone, so controller.ranges must end u_min's below u_max's: separate the two"
        )


def tunable_law(
    request: Request,
    says: str,
    pid: Pid,
    parameters: Sequence[TunableParameter],
    wires: Wires,
    ahead: Feedforward | None,
) -> Law:
    """Write the law over the whole range of its parameters."""
    names = [parameter.signal.name for parameter in parameters]
    ends = [{p.signal.low, p.signal.high, p.default} for p in parameters]
    corners = [_with(pid, dict(zip(names, values, strict=True))) for values in itertools.product(*ends)]
    low, high = min(corner.u_min for corner in corners), max(corner.u_max for corner in corners)
    target = pid.target and (min(pid.target[0], low), max(pid.target[1], high))
    corners = [replace(corner, target=target) for corner in corners]
    whole = replace(whole_pid(corners), u_min=low, u_max=high)
    if "ki" in names and pid.anti_windup.one_sign:
        whole = replace(whole, ki=max((corner.ki for corner in corners), key=abs))
    larger = with_parameters(request, parameters)
    z = {signal.name: ca.SX.sym(signal.name) for signal in larger.inputs}
    given, named = factors(whole), {}
    for name in names:
        symbol = z[name]
        if name == "ki":
            named["ki_step"] = (wires.output.unit + "/" + wires.measurement.unit, symbol * pid.period)
            given = replace(given, step=named["ki_step"][1])
            if pid.form.trapezoidal:
                given = replace(given, half_step=symbol * (pid.period / 2))
        elif name == "kd":
            named["kd_step"] = (wires.output.unit + "/" + wires.measurement.unit, symbol * (replace(pid, kd=1.0).slope))
            given = replace(given, slope=named["kd_step"][1])
        else:
            given = replace(given, **{name: symbol})
    ranges = box_ranges(corners, whole, wires.reference, wires.measurement, wires.output)
    if ahead is not None:
        ranges = (*ranges, *ahead.states(whole.differentiates))
    return held(write(larger, says, whole, given, z, wires, ranges, named, ahead), parameters)


def _with(pid: Pid, values: Mapping[str, float]) -> Pid:
    """Return the PID with some of its parameters at other values."""
    return replace(
        pid,
        kp=values.get("kp", pid.kp),
        ki=values.get("ki", pid.ki),
        kd=values.get("kd", pid.kd),
        b=values.get("b", pid.b),
        c=values.get("c", pid.c),
        u_min=values.get("u_min", pid.u_min),
        u_max=values.get("u_max", pid.u_max),
    )

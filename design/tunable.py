"""Parameters that can be set on the running target: declared with a range, kept by the controller beside its state.

    [controller]
    tunable = ["kp", "ki"]
    [controller.ranges]
    kp = [0.0, 0.2]
    ki = [0.0, 5.0]

A kind writes its law as if each parameter were an input of that range; `held` then turns these inputs into state that
a step leaves as it is. So whatever is proven of the law holds for every value in the declared range, and for every
change of it between two samples.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import casadi as ca

from firmloop.design.design import Request
from firmloop.design.law import DesignError, Law, Scalar
from firmloop.design.table import SET_WHILE_RUNNING, choice, numbers
from firmloop.identify.signal import Signal

KEYS = SET_WHILE_RUNNING
WHY = "set from outside, refused beyond its declared range; a step leaves it alone"


@dataclass(frozen=True, slots=True)
class TunableParameter:
    """A parameter with its declared range, and what it is at the start."""

    signal: Signal
    default: float


def read_parameters(
    table: Mapping[str, object],
    defaults: Mapping[str, tuple[str, float]],
    usual: Mapping[str, tuple[float, float]],
    owner: str,
) -> tuple[TunableParameter, ...]:
    """Read `tunable` and `ranges`; `defaults` gives unit and value of each parameter that `owner` can leave open.

    `usual` are ranges to propose for some of them; for the others it is from 0 to twice the value.
    """
    listed = table.get("tunable", [])
    ranges = table.get("ranges", {})
    if not isinstance(listed, list | tuple):
        raise DesignError(f'controller.tunable = {listed!r} is not a list; write it like tunable = ["kp", "ki"]')
    if not isinstance(ranges, Mapping):
        raise DesignError(f"controller.ranges = {ranges!r} is not a table; write [controller.ranges] and kp = [0, 1]")
    names: list[str] = []
    for entry in listed:
        if not isinstance(entry, str) or entry not in defaults:
            raise DesignError(
                f"controller.tunable names {entry!r}, which {owner} cannot have tuned on the target; "
                f"it can: {', '.join(defaults)}"
            )
        if entry in names:
            raise DesignError(f"controller.tunable names '{entry}' twice; name each parameter once")
        names.append(choice({"tunable": entry}, "tunable", None, defaults))
    for name in ranges:
        if name not in names:
            raise DesignError(
                f"controller.ranges.{name} is the range of nothing that can be tuned; add '{name}' to "
                "controller.tunable or remove its range"
            )
    missing = [name for name in names if name not in ranges]
    if missing:
        ends = {name: usual.get(name) or _around(defaults[name][1]) for name in missing}
        lines = {name: f"{name} = {list(map(float, ends[name])) if name in ends else ranges[name]}" for name in names}
        instead = ", in the place of [controller.ranges]" if ranges else ""
        raise DesignError(
            f"controller.ranges.{missing[0]} is missing; what can be tuned needs the range it is proven for, such as "
            f"this in [controller]{instead}: ranges = {{ {', '.join(lines.values())} }}"
        )
    return tuple(_parameter(ranges, name, *defaults[name]) for name in names)


def _around(default: float) -> tuple[float, float]:
    """Return a range from 0 to twice a value, or to 1."""
    low, high = sorted((0.0, 2.0 * default or 1.0))
    return low, high


def _parameter(ranges: Mapping[str, object], name: str, unit: str, default: float) -> TunableParameter:
    key = f"ranges.{name}"
    found = numbers({key: ranges[name]}, key, None)
    if len(found) != 2 or not found[0] < found[1]:
        raise DesignError(
            f"controller.ranges.{name} = {list(found)} is not a range; write the low end and a higher one"
        )
    low, high = found
    if not low <= default <= high:
        raise DesignError(
            f"controller.ranges.{name} = [{low:g}, {high:g}] does not hold the value at the start, {default:g}; "
            "widen the range or correct the value"
        )
    return TunableParameter(Signal(name, unit, low, high), default)


def with_parameters(request: Request, parameters: Sequence[TunableParameter]) -> Request:
    """Return the request with each parameter as a further input."""
    return replace(request, inputs=request.inputs + tuple(parameter.signal for parameter in parameters))


def held(law: Law, parameters: Sequence[TunableParameter]) -> Law:
    """Turn the last inputs of `law`, its parameters, into state that keeps itself."""
    count, order = len(law.inputs) - len(parameters), len(law.state)
    scalar = law.last
    x, z = ca.SX.sym("x", order + len(parameters)), ca.SX.sym("z", count)
    following, u, flags, named = scalar.function(x[:order], ca.vertcat(z, x[order:]))
    stage = ca.Function(
        "law",
        [x, z],
        [ca.vertcat(following, x[order:]), u, flags, named],
        ["x", "z"],
        ["x_next", "u", "flags", "named"],
    )
    first = None
    if law.first is not None:
        begun = law.first(x[:order], ca.vertcat(z, x[order:]))
        first = ca.Function("first", [x, z], [ca.vertcat(begun, x[order:])], ["x", "z"], ["x_first"])
    names = ", ".join(f"{p.signal.name} {p.signal.low:.6g} to {p.signal.high:.6g}" for p in parameters)
    return replace(
        law,
        says=f"{law.says}; tunable: {names}",
        inputs=law.inputs[:count],
        state=law.state + tuple(parameter.signal for parameter in parameters),
        start=law.start + tuple(parameter.default for parameter in parameters),
        why=law.why + (WHY,) * len(parameters),
        stages=(Scalar(stage, scalar.named),),
        rest=law.rest[:count],
        first=first,
        tunable=tuple(parameter.signal.name for parameter in parameters),
    )

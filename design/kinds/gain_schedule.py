"""Gain schedule: a PID whose factors follow a signal, linearly between points, with one state for all of them.

With s the signal `schedule_on` and p_i the value of a factor at `points[i]`::

    t_i = min(max((s - points[i]) / (points[i+1] - points[i]), 0), 1)
    p   = p_0 + sum_i t_i (p_(i+1) - p_i)

and the equations of `pid.py`. Below the first and above the last point the outer controllers hold. The factors are
kp, b, c, ki h, kd/(tf+h), tf/(tf+h) and h/tt (in Tustin's form its own): kp, ki and kd, as b and c, are interpolated as
they are where tf is the same at every point. The integral is kept in the output's unit, ki inside, so that a change of
gains moves nothing by itself: the transfer is bumpless.

`controllers` holds one table per point, `points` its value of the signal; or `points` holds the tables, with the value
as `at`. Each table is that of a `pid` (`kind` may be left out); limits, forms and modes must agree. A point may be
tuned: `tune` and that rule's keys stand in its table, and `plant = { gain = 3.0 }` names the parameters of the
project's plant that are different at that operating point.

The range of the state is proven in `pid_box.py`.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import replace

import casadi as ca

from design.feedforward import feedforward, position_of
from design.kinds import Design, Kind, Request
from design.kinds.pid import KEYS as PID_KEYS
from design.kinds.pid import find_gains, find_wires, given_gains, read_pid
from design.kinds.pid_box import box_ranges, whole_pid
from design.kinds.pid_range import Pid
from design.kinds.pid_write import Factor, Factors, Wires, factors, write
from design.law import DesignError
from design.table import check_keys, choice, numbers, real
from design.tuning import Gains
from identify.signal import Signal

KEYS = ("schedule_on", "points", "controllers", "feedforward")
NOT_AT_A_POINT = ("manual", "automatic", "tracking", "feedforward", "tunable", "ranges")
SHARED = ("form", "anti_windup", "u_min", "u_max", "rate")  # what one law has one of


def design(request: Request) -> Design:
    """Read one PID per point and write the law that goes from one to the other."""
    check_keys(request.table, KEYS, "a gain_schedule")
    at, tables = _points(request.table)
    by_name = {wire.name: wire for wire in request.inputs}
    schedule = by_name[choice(request.table, "schedule_on", None, by_name)]
    loop = request.inputs
    if schedule.name not in ("reference", "measurement") and len(loop) > 2:
        loop = tuple(wire for wire in request.inputs if wire.name != schedule.name)
    loop = tuple(wire for wire in loop if wire.name != position_of(request.table))
    wires = replace(find_wires(replace(request, table=tables[0], inputs=loop)), schedule=schedule)
    misplaced = [key for key in NOT_AT_A_POINT if any(key in table for table in tables)]
    if misplaced:
        raise DesignError(f"controller.{misplaced[0]} does not belong to a point of a gain_schedule; remove it there")
    pids = []
    for k, table in enumerate(tables):
        try:
            pids.append(read_pid(table, request.period, wires, _gains(request, table, wires)))
        except DesignError as error:
            raise DesignError(f"point {k + 1} of the gain_schedule: {error}") from None
    _check_alike(pids)
    filters = [pid.tf for pid in pids if pid.differentiates]
    for k, table in enumerate(tables):
        if filters and not pids[k].differentiates and "tf_s" not in table:
            pids[k] = replace(pids[k], tf=filters[0])  # without a derivative there is no filter to go over to
    ahead = feedforward(request.table, request.plant, request.period, (wires.reference, wires.output), request.inputs)
    whole = replace(whole_pid(pids), added=ahead.size() if ahead else 0.0)
    z = {wire.name: ca.SX.sym(wire.name) for wire in request.inputs}
    named: dict[str, tuple[str, ca.SX]] = {}
    shares = _shares(z[schedule.name], at, named)
    says = _says(pids, at, schedule) + (ahead.says() if ahead else "")
    mixed = _mixed([factors(pid) for pid in pids], shares, named)
    ranges = box_ranges(pids, whole, wires.reference, wires.measurement, wires.output)
    if ahead is not None:
        ranges = (*ranges, *ahead.states(whole.differentiates))
    law = write(request, says, whole, mixed, z, wires, ranges, named, ahead)
    figures = {f"{name}_{k}": getattr(pid, name) for k, pid in enumerate(pids, 1) for name in ("kp", "ki", "kd")}
    return Design(law, figures, None, {}, ahead.missed if ahead else {})


def _gains(request: Request, table: Mapping[str, object], wires: Wires) -> Gains:
    """Take the gains of a point, or tune them for the plant as it is there: `plant` holds what is different."""
    if "tune" not in table:
        return given_gains(table)
    own = {key: value for key, value in table.items() if key != "plant"}
    plant, changed = request.plant, table.get("plant", {})
    if not isinstance(changed, dict):
        raise DesignError(f"controller.plant = {changed!r} is no table; write it like plant = {{ gain = 3.0 }}")
    if plant is not None:
        names = [parameter.name for parameter in plant.parameters]
        for name in changed:
            choice({"plant": name}, "plant", None, names)
        plant = replace(
            plant,
            parameters=tuple(
                replace(parameter, value=real(changed, parameter.name, parameter.value))
                for parameter in plant.parameters
            ),
        )
    return find_gains(replace(request, table=own, plant=plant), wires)[1]


def _points(table: Mapping[str, object]) -> tuple[tuple[float, ...], list[Mapping[str, object]]]:
    """Return the values of the signal and the tables, each a pid's own."""
    points = table.get("points")
    if isinstance(points, list | tuple) and points and all(isinstance(entry, dict) for entry in points):
        if "controllers" in table:
            raise DesignError("controller.controllers is given beside points that are tables; remove one of the two")
        given = [dict(entry) for entry in points]
        if any("at" not in entry for entry in given):
            raise DesignError("controller.points has a table without 'at', the value of the signal; add it to each")
        at = numbers({"points": [entry.pop("at") for entry in given]}, "points", None)
    else:
        at = numbers(table, "points", None)
        listed = table.get("controllers")
        if not isinstance(listed, list | tuple) or not all(isinstance(entry, dict) for entry in listed) or not listed:
            raise DesignError(
                "controller.controllers is missing or no list of tables; give one [[controller.controllers]] a point"
            )
        given = [dict(entry) for entry in listed]
    if len(given) != len(at) or len(at) < 2:
        raise DesignError(
            f"controller.points has {len(at)} values and {len(given)} controllers; give as many of each, at least two"
        )
    for one, other in itertools.pairwise(at):
        if not one < other:
            raise DesignError(f"controller.points must rise, but {other:g} follows {one:g}; sort them, each value once")
    for k, entry in enumerate(given, 1):
        kind = entry.pop("kind", "pid")
        if kind != "pid":
            raise DesignError(f"point {k} of the gain_schedule has kind = '{kind}'; only 'pid' can be interpolated")
        if "tune" not in entry:
            check_keys(entry, PID_KEYS, f"point {k} of the gain_schedule, a pid,")
    return at, list(given)


def _check_alike(pids: Sequence[Pid]) -> None:
    first = pids[0]
    for k, pid in enumerate(pids[1:], 2):
        for name in SHARED:
            if getattr(pid, name) != getattr(first, name):
                raise DesignError(
                    f"points 1 and {k} of the gain_schedule have {name} = {getattr(first, name)} and "
                    f"{getattr(pid, name)}; every point must have the same"
                )
        if pid.anti_windup == "clamping" and (pid.ki > 0) != (first.ki > 0):
            raise DesignError(
                f"points 1 and {k} of the gain_schedule have ki of different signs; clamping needs one sign"
            )


def _shares(s: ca.SX, at: Sequence[float], named: dict[str, tuple[str, ca.SX]]) -> list[ca.SX]:
    """Return t_i for every gap between two points."""
    shares = []
    for k, (one, other) in enumerate(itertools.pairwise(at), 1):
        share = ca.fmin(ca.fmax((s - one) * (1 / (other - one)), 0), 1)
        named[f"share_{k}"] = ("1", share)
        shares.append(share)
    return shares


def _mixed(given: Sequence[Factors], shares: Sequence[ca.SX], named: dict[str, tuple[str, ca.SX]]) -> Factors:
    """Interpolate every factor that is not the same at all points."""
    found: dict[str, Factor] = {}
    for name in Factors.__slots__:
        values = [float(getattr(each, name)) for each in given]
        mixed: Factor = values[0]
        for share, (one, other) in zip(shares, itertools.pairwise(values), strict=True):
            if one != other:
                mixed = mixed + (other - one) * share
        found[name] = mixed
        if isinstance(mixed, ca.SX):
            named[f"{name}_now"] = ("", mixed)
    return Factors(**found)


def _says(pids: Sequence[Pid], at: Sequence[float], schedule: Signal) -> str:
    rows = [f"{value:.6g}: kp {p.kp:.6g} ki {p.ki:.6g} kd {p.kd:.6g}" for value, p in zip(at, pids, strict=True)]
    return f"PID scheduled on {schedule.name} ({schedule.unit}), {'; '.join(rows)}"


KIND = Kind(
    name="gain_schedule",
    says="PID whose gains follow a signal, linearly between points",
    design=design,
    example=Request(
        name="valve_flow",
        table={
            "schedule_on": "opening",
            "points": [10.0, 40.0, 90.0],
            "controllers": [
                {"kp": 0.9, "ki": 2.0, "kd": 0.01, "tf_s": 0.05, "tt_s": 0.4},
                {"kp": 0.5, "ki": 1.5, "kd": 0.006, "tf_s": 0.05, "tt_s": 0.4},
                {"kp": 0.2, "ki": 0.6, "kd": 0.0, "tf_s": 0.05, "tt_s": 0.4},
            ],
        },
        period=0.01,
        inputs=(
            Signal("reference", "l/min", 0.0, 60.0),
            Signal("measurement", "l/min", 0.0, 60.0),
            Signal("opening", "%", 0.0, 100.0),
        ),
        outputs=(Signal("output", "%", 0.0, 100.0),),
        plant=None,
    ),
)

"""PIDs of a gain schedule as one PID: its factors follow the signal, and one state serves all of them.

The equations stand in `gain_schedule.py`, the range of the state is proven in `pid_box.py`.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace

import casadi as ca

from firmloop.design.design import Design, Request
from firmloop.design.kinds.pid.box import box_ranges, whole_pid
from firmloop.design.kinds.pid.equations import Factor, Factors, Wires, factors, write
from firmloop.design.kinds.pid.kind import KEYS as PID_KEYS
from firmloop.design.kinds.pid.kind import find_gains, find_wires, given_gains, read_pid
from firmloop.design.kinds.pid.ranges import Pid
from firmloop.design.law import DesignError
from firmloop.design.linear.blend import Schedule, shares
from firmloop.design.models.feedforward import feedforward
from firmloop.design.table import check_keys
from firmloop.design.tuning import Gains
from firmloop.identify.signal import Signal

NOT_AT_A_POINT = ("manual", "automatic", "tracking", "feedforward", "tunable", "ranges")
SHARED = ("form", "anti_windup", "u_min", "u_max", "rate")  # what one law has one of


def scheduled_pid(request: Request, schedule: Schedule, points: Sequence[Request]) -> Design:
    """Read one PID per point and write the law that goes from one to the other."""
    tables = [point.table for point in points]
    for k, table in enumerate(tables, 1):
        if "tune" not in table:
            check_keys(table, PID_KEYS, f"point {k} of the gain_schedule, a pid,")
    wires = replace(find_wires(points[0]), schedule=schedule.signal)
    misplaced = [key for key in NOT_AT_A_POINT if any(key in table for table in tables)]
    if misplaced:
        raise DesignError(f"controller.{misplaced[0]} does not belong to a point of a gain_schedule; remove it there")
    pids = []
    for k, point in enumerate(points, 1):
        try:
            pids.append(read_pid(point.table, request.period, wires, _gains(point, wires)))
        except DesignError as error:
            raise DesignError(f"point {k} of the gain_schedule: {error}") from None
    _check_alike(pids)
    filters = [pid.tf for pid in pids if pid.differentiates]
    for k, table in enumerate(tables):
        if filters and not pids[k].differentiates and "tf_s" not in table:
            pids[k] = replace(pids[k], tf=filters[0])  # without a derivative there is no filter to go over to
    ahead = feedforward(request.table, request.plant, request.period, (wires.reference, wires.output), request.inputs)
    whole = replace(whole_pid(pids), added=ahead.size() if ahead else 0.0)
    z = {wire.name: ca.SX.sym(wire.name) for wire in request.inputs}
    named: dict[str, tuple[str, ca.SX]] = {}
    given = shares(z[schedule.signal.name], schedule.at, named)
    says = _says(pids, schedule.at, schedule.signal) + (ahead.says() if ahead else "")
    mixed = _mixed([factors(pid) for pid in pids], given, named)
    ranges = box_ranges(pids, whole, wires.reference, wires.measurement, wires.output)
    if ahead is not None:
        ranges = (*ranges, *ahead.states(whole.differentiates))
    law = write(request, says, whole, mixed, z, wires, ranges, named, ahead)
    figures = {f"{name}_{k}": getattr(pid, name) for k, pid in enumerate(pids, 1) for name in ("kp", "ki", "kd")}
    return Design(law, figures, None, {}, ahead.missed if ahead else {})


def _gains(point: Request, wires: Wires) -> Gains:
    """Take the gains of a point, or tune them for the plant as it is there."""
    return find_gains(point, wires)[1] if "tune" in point.table else given_gains(point.table)


def _check_alike(pids: Sequence[Pid]) -> None:
    first = pids[0]
    for k, pid in enumerate(pids[1:], 2):
        for name in SHARED:
            if getattr(pid, name) != getattr(first, name):
                raise DesignError(
                    f"points 1 and {k} of the gain_schedule have {name} = {getattr(first, name)} and "
                    f"{getattr(pid, name)}; every point must have the same"
                )
        if pid.anti_windup.one_sign and (pid.ki > 0) != (first.ki > 0):
            raise DesignError(
                f"points 1 and {k} of the gain_schedule have ki of different signs; {pid.anti_windup} needs one sign"
            )


def _mixed(values_at: Sequence[Factors], given: Sequence[ca.SX], named: dict[str, tuple[str, ca.SX]]) -> Factors:
    """Interpolate every factor that is not the same at all points."""
    found: dict[str, Factor] = {}
    for name in Factors.__slots__:
        values = [float(getattr(each, name)) for each in values_at]
        mixed: Factor = values[0]
        for share, (one, other) in zip(given, itertools.pairwise(values), strict=True):
            if one != other:
                mixed = mixed + (other - one) * share
        found[name] = mixed
        if isinstance(mixed, ca.SX):
            named[f"{name}_now"] = ("", mixed)
    return Factors(**found)


def _says(pids: Sequence[Pid], at: Sequence[float], schedule: Signal) -> str:
    rows = [f"{value:.6g}: kp {p.kp:.6g} ki {p.ki:.6g} kd {p.kd:.6g}" for value, p in zip(at, pids, strict=True)]
    return f"PID scheduled on {schedule.name} ({schedule.unit}), {'; '.join(rows)}"

"""Gain schedule: controllers that follow a signal, linearly between points.

With s the signal `schedule_on`::

    t_i = min(max((s - points[i]) / (points[i+1] - points[i]), 0), 1)

Below the first and above the last point the outer controllers hold.

PIDs (`kind = "pid"` at every point, or left out) become one PID with one state. With p_i the value of a factor at
`points[i]`, p = p_0 + sum_i t_i (p_(i+1) - p_i), and the equations of `pid.py`. The factors are kp, b, c, ki h,
kd/(tf+h), tf/(tf+h) and h/tt (in Tustin's form its own): kp, ki and kd, as b and c, are interpolated as they are where
tf is the same at every point. The integral is kept in the output's unit, ki inside, so that a change of gains moves
nothing by itself: the transfer is bumpless. Limits, forms and modes must agree.

Other kinds, those whose equations are linear before the limit (`state_space`, `transfer_function`, `lead_lag`, `notch`,
`state_feedback`), also mixed: v = v_0 + sum_i t_i (v_(i+1) - v_i) of what they put out before the limit, one limit
behind it, see `blend.py`. `u_min` and `u_max` must agree.

`controllers` holds one table per point, `points` its value of the signal; or `points` holds the tables, with the value
as `at`. A point may be tuned or weighted: `tune` or `Q` and `R` and their keys stand in its table, and
`plant = { gain = 3.0 }` names the parameters of the project's plant that are different at that operating point.

The signal is no input of the controllers, unless it is called reference or measurement or they need it: where there
are no more than two inputs, or where the tables fit the inputs only with it (a column of B, a state that K weighs).
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import replace

from firmloop.design.design import Design, Kind, Operating, Request
from firmloop.design.draft import Draft
from firmloop.design.kinds import kind_of, kinds
from firmloop.design.kinds.pid.schedule import scheduled_pid
from firmloop.design.law import DesignError, Law
from firmloop.design.linear.blend import Schedule, blended
from firmloop.design.models.feedforward import position_of
from firmloop.design.table import check_keys, choice, limits, numbers, real
from firmloop.identify.plants.plant import Plant
from firmloop.identify.signal import Signal

KEYS = ("schedule_on", "points", "controllers", "feedforward")
PID = "pid"


def design(request: Request) -> Design:
    """Read one controller per point and write the law that goes from one to the other."""
    check_keys(request.table, KEYS, "a gain_schedule")
    at, tables = _points(request.table)
    by_name = {wire.name: wire for wire in request.inputs}
    signal = by_name[choice(request.table, "schedule_on", None, by_name)]
    names = [str(table.get("kind", PID)) for table in tables]
    points = [
        replace(
            request,
            table={key: value for key, value in table.items() if key not in ("kind", "plant")},
            plant=_plant_at(request.plant, table, k),
        )
        for k, table in enumerate(tables, 1)
    ]
    position = position_of(request.table)
    wires = tuple(wire for wire in request.inputs if wire.name != position)
    others = tuple(wire for wire in wires if wire != signal)
    apart = signal.name not in ("reference", "measurement")
    if all(name == PID for name in names):
        schedule = Schedule(signal, at, others if apart and len(others) > 1 else wires)
        made = scheduled_pid(request, schedule, [replace(point, inputs=schedule.loop) for point in points])
        return replace(made, operating=_operating(made.law, schedule, points))
    _check_kinds(names)
    if "feedforward" in request.table:
        raise DesignError("controller.feedforward of a gain_schedule is for points that are pids; remove it")
    schedule = Schedule(signal, at, others if apart else request.inputs)
    try:
        drafts = _drafts(points, names, schedule.loop)
    except DesignError:
        if not apart:
            raise
        schedule = Schedule(signal, at, request.inputs)
        try:
            drafts = _drafts(points, names, schedule.loop)
        except DesignError:
            drafts = _drafts(points, names, others)  # what is wrong without the signal says more
    low, high = _limits(points)
    rows = "; ".join(f"{value:.6g}: {draft.says}" for value, draft in zip(at, drafts, strict=True))
    says = f"scheduled on {signal.name} ({signal.unit}), {rows}"
    figures = {f"{key}_{k}": value for k, draft in enumerate(drafts, 1) for key, value in draft.figures.items()}
    law = blended(request, schedule, drafts, says, low, high)
    return Design(law, figures, None, {}, operating=_operating(law, schedule, points))


def _operating(law: Law, schedule: Schedule, points: Sequence[Request]) -> tuple[Operating, ...]:
    """Return the law resting at each point, beside the plant there; none where the signal is the measurement."""
    signal = schedule.signal
    if signal.name in ("reference", "measurement"):
        return ()
    rest = law.rest or tuple(min(max(0.0, wire.low), wire.high) for wire in law.inputs)
    found = []
    for value, point in zip(schedule.at, points, strict=True):
        there = tuple(value if wire.name == signal.name else at for wire, at in zip(law.inputs, rest, strict=True))
        if point.plant is not None:
            says = f"{signal.name} {value:g} {signal.unit}".rstrip()
            found.append(Operating(says, replace(law, rest=there), point.plant))
    return tuple(found)


def _check_kinds(names: Sequence[str]) -> None:
    """Refuse a kind that has no linear equations, and a PID beside others, whose integral they would not share."""
    for k, name in enumerate(names, 1):
        kind = kind_of(name)
        if name != PID and (kind is None or kind.draft is None):
            fit = [PID, *(kind.name for kind in kinds().values() if kind.draft is not None)]
            raise DesignError(
                f"point {k} of the gain_schedule has kind = '{name}', which cannot be interpolated; "
                f"known: {', '.join(fit)}"
            )
    if PID in names:
        one, other = names.index(PID) + 1, next(k for k, name in enumerate(names, 1) if name != PID)
        raise DesignError(
            f"point {one} of the gain_schedule is a pid and point {other} a {names[other - 1]}; "
            "make every point a pid, or write the pid as a transfer_function"
        )


def _drafts(points: Sequence[Request], names: Sequence[str], loop: tuple[Signal, ...]) -> list[Draft]:
    found = []
    for k, (point, name) in enumerate(zip(points, names, strict=True), 1):
        kind = kind_of(name)
        assert kind is not None and kind.draft is not None, "checked before"
        try:
            found.append(kind.draft(replace(point, inputs=loop)))
        except DesignError as error:
            raise DesignError(f"point {k} of the gain_schedule: {error}") from None
    return found


def _limits(points: Sequence[Request]) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return the limits that all points have."""
    found = []
    for k, point in enumerate(points, 1):
        try:
            found.append(limits(point.table, point.outputs))
        except DesignError as error:
            raise DesignError(f"point {k} of the gain_schedule: {error}") from None
        for key, first, own in zip(("u_min", "u_max"), found[0], found[-1], strict=True):
            if first != own:
                one, other = (", ".join(f"{value:g}" for value in values) for values in (first, own))
                raise DesignError(
                    f"points 1 and {k} of the gain_schedule have {key} = {one} and {other}; "
                    "every point must have the same"
                )
    return found[0]


def _plant_at(plant: Plant | None, table: Mapping[str, object], k: int) -> Plant | None:
    """Return the plant as it is at a point: its table `plant` holds the parameters that are different."""
    changed = table.get("plant", {})
    if not isinstance(changed, dict):
        raise DesignError(f"controller.plant = {changed!r} is no table; write it like plant = {{ gain = 3.0 }}")
    if not changed:
        return plant
    if plant is None:
        raise DesignError(f"point {k} of the gain_schedule has a table plant, but the project has no [plant]; add it")
    names = [parameter.name for parameter in plant.parameters]
    for name in changed:
        choice({"plant": name}, "plant", None, names)
    return replace(
        plant,
        parameters=tuple(
            replace(parameter, value=real(changed, parameter.name, parameter.value)) for parameter in plant.parameters
        ),
    )


def _points(table: Mapping[str, object]) -> tuple[tuple[float, ...], list[Mapping[str, object]]]:
    """Return the values of the signal and the tables."""
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
    return at, list(given)


OPENING = Signal("opening", "%", 0.0, 100.0)
CART = {
    "kind": "state_feedback",
    **{"B": [[0.0], [0.02], [0.11]], "C": [[1.0, 0.0, 0.0]], "R": 0.05, "integral_weight": 900.0},
    **{"observer": "kalman", "process_noise": [1e-6, 1e-3, 1e-2], "measurement_noise": 1e-5},
}
FILTERS = Request(
    name="filters",
    table={
        "schedule_on": "measurement",
        "points": [-1.5, 0.0, 2.0],
        "controllers": [
            {"kind": "lead_lag", "gain": 3.0, "frequency_rad_s": 120.0, "phase_deg": 50.0},
            {"kind": "notch", "frequency_hz": 85.0, "damping": 0.3, "depth": 0.05, "gain": 2.0},
            {"kind": "transfer_function", "numerator": [0.4, 0.2], "denominator": [1.0, -1.1, 0.4]},
        ],
    },
    period=0.001,
    inputs=(Signal("reference", "rad", -3.2, 3.2), Signal("measurement", "rad", -3.2, 3.2)),
    outputs=(Signal("output", "A", -5.0, 5.0),),
    plant=None,
)
MATRICES = Request(
    name="matrices",
    table={
        "schedule_on": "opening",
        "points": [20.0, 80.0],
        "controllers": [
            {"kind": "state_space", "A": [[0.9, 0.2], [-0.2, 0.9]], "B": [[0.1], [0.2]], "C": [[1.5, 0], [0, -2.0]]},
            {"kind": "state_space", "A": [[0.9, 0.2], [-0.2, 0.9]], "B": [[0.1], [0.2]], "C": [[0.5, 1], [1, -0.5]]},
        ],
    },
    period=0.002,
    inputs=(Signal("measurement", "m", -1.0, 2.0), OPENING),
    outputs=(Signal("left", "N", -2.0, 2.0), Signal("right", "N", -2.5, 2.5)),
    plant=None,
)
FEEDBACK = Request(
    name="feedback",
    table={
        "schedule_on": "opening",
        "points": [10.0, 90.0],
        "controllers": [
            {**CART, "A": [[1.0, 0.009, 0.0], [0.0, 0.82, 0.35], [0.0, -0.12, 0.64]], "Q": [400.0, 0.1, 0.01]},
            {**CART, "A": [[1.0, 0.009, 0.0], [0.0, 0.72, 0.35], [0.0, -0.12, 0.64]], "Q": [200.0, 0.1, 0.01]},
        ],
    },
    period=0.01,
    inputs=(Signal("reference", "m", -0.4, 0.4), Signal("measurement", "m", -0.5, 0.5), OPENING),
    outputs=(Signal("output", "V", -12.0, 12.0),),
    plant=None,
)
KIND = Kind(
    name="gain_schedule",
    says="controllers that follow a signal, linearly between points",
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
            OPENING,
        ),
        outputs=(Signal("output", "%", 0.0, 100.0),),
        plant=None,
    ),
    further=(FILTERS, MATRICES, FEEDBACK),
)

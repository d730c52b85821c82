"""Nonlinear model predictive control: the plant's own equations over the horizon, one Gauss-Newton step each sample.

    min 1/2 sum (x - t)'Q(x - t) + u'Ru + d'R_change d + 1/2 (x[N] - t)'P(x[N] - t),   u_min <= u <= u_max

for x[k+1] the plant one period later, from [plant] with the effects that can be made smooth
(`design/models/smooth.py`), and d the change of u from sample to sample. `quantize/twins/rti.py` says how a
step is taken. Keys beside those:

- `states` names the inputs that carry x[0], in the plant's order; without it they are all inputs but the reference.
- `target`: t, one number a state; without it zero. `u_target`: what u is weighed from; without it zero.
- `reference` names an input: the state that is the plant's first output is led there instead.
- `x_min`, `x_max`: limits of states on x[1]..x[N], hard.
- `P`: without it the Riccati solution at the target; where there is none, Q.
- `iterations` of one sample; `warm_start = false` starts each from no move at all.
- `smooth`: speed within which a dry friction changes its sign, in the speed's unit.
- `parts`: Runge-Kutta steps of one sample; without it as many as the equations ask for.
- `budget`: changes of the active set in one step, by default four for each limit, down to one where there are many;
  beyond it the step is cut short, which may come before it is found that no moves keep all limits.

Where a step fails (`capped`, `infeasible`), the output is that without limits, limited, and the next sample starts
anew. `unsettled`: the step still changed a move by more than a hundredth of its range, so the plan is not optimal yet.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import casadi as ca
import numpy as np
import numpy.typing as npt
import scipy

from firmloop.design.design import Design, Kind, Request
from firmloop.design.kinds.mpc.read import whole
from firmloop.design.law import DesignError, Flag, Horizon, Law, Scalar, Solve
from firmloop.design.linear.linear_law import check_names, symbols
from firmloop.design.models.model import weights
from firmloop.design.models.smooth import Smooth, parts_of, sampled, smooth_rate
from firmloop.design.table import check_keys, each, limits, numbers, positive, truth
from firmloop.identify.plants.ode import make_ode
from firmloop.identify.plants.plant import Plant
from firmloop.identify.signal import Signal

Array = npt.NDArray[np.float64]

KEYS = (
    *("horizon", "states", "Q", "R", "P", "R_change", "u_min", "u_max", "x_min", "x_max", "target", "u_target"),
    *("reference", "iterations", "warm_start", "smooth", "parts", "budget"),
)
LONGEST = 200  # samples of a horizon
MOST_ROWS = 80  # limits of a horizon: their tableau is the largest part of the memory
LARGE = 8_000  # numbers in the tableaus of all changes of a step, by default: some 70,000 instructions
WIDER = 4.0  # a plan's states stay within so many times the range of their signal
UNSETTLED = 0.01  # share of a move's range
PLAN_WHY = "limited: a plan is where the next sample starts from, and what it lacks is taken up there"


@dataclass(frozen=True, slots=True)
class NmpcSetup:
    """What the table asks for, read and checked."""

    plant: Smooth
    wires: tuple[int, ...]  # inputs that carry the states
    reference: int | None  # index of that input
    led: int  # the state that it leads
    target: Array
    horizon: Horizon
    warm: bool


def design(request: Request) -> Design:
    """Sample the plant, weigh its states and write the law."""
    check_keys(request.table, KEYS, "an nmpc")
    setup = _setup(request)
    figures = {
        "moves": float(setup.horizon.length * len(request.outputs)),
        "rows": float(setup.horizon.length * len(setup.horizon.low)),
    }
    return Design(_law(request, setup), figures, None, {})


def _setup(request: Request) -> NmpcSetup:
    table, plant = request.table, request.plant
    if plant is None:
        raise DesignError("controller.kind = 'nmpc' needs the plant's equations: give [plant]")
    if not request.outputs or len(plant.inputs) != len(request.outputs):
        raise DesignError(
            f"the plant has {len(plant.inputs)} input(s) and the controller {len(request.outputs)} output(s); "
            "correct controller.outputs"
        )
    reference, wires = _wires(request, plant)
    n, m = len(plant.states), len(plant.inputs)
    ranges = [request.inputs[k] for k in wires]
    smooth = smooth_rate(plant, positive(table, "smooth", _slow(plant, ranges)))
    target = np.array(numbers(table, "target", [0.0] * n))
    rest = np.array(numbers(table, "u_target", [0.0] * m))
    for key, found, size in (("target", target, n), ("u_target", rest, m)):
        if len(found) != size:
            raise DesignError(f"controller.{key} has {len(found)} numbers; it needs {size}")
    ends = np.array([[wire.low, wire.high] for wire in ranges]).T
    parts = whole(table, "parts", 0, 0, 20)
    if not parts:
        parts = parts_of(smooth, request.period, np.vstack([target, np.zeros(n), ends, ends.mean(axis=0)]))
    model = sampled(smooth, plant.inputs, request.period, parts)
    q, r = weights(table, "Q", n, False), weights(table, "R", m, True)
    p = weights(table, "P", n, False) if "P" in table else _terminal(model, target, rest, q, r)
    change = np.array(each(table, "R_change", [0.0] * m))
    if not np.all(np.isfinite(change) & (change >= 0)):
        raise DesignError(f"controller.R_change = {table['R_change']!r} is out of range; it must be 0 or more")
    length = whole(table, "horizon", None, 1, LONGEST)
    low, high, weight, limited = _limits(request, ranges)
    rows = length * len(low)
    if rows > MOST_ROWS:
        raise DesignError(
            f"controller.horizon = {length} has {rows} limits of inputs and states; at most {MOST_ROWS} fit a "
            "microcontroller's stack: give a shorter horizon and a longer period_s, or limit fewer states"
        )
    changes = min(4 * rows, max(rows, LARGE // rows**2))
    horizon = Horizon(
        model, length, q, r, p, change, rest, low, high, weight, limited,
        whole(table, "iterations", 1, 1, 20), whole(table, "budget", changes, 1, 10_000),
    )  # fmt: skip
    led = _led(plant) if reference is not None else 0
    return NmpcSetup(smooth, wires, reference, led, target, horizon, truth(table, "warm_start", True))


def _wires(request: Request, plant: Plant) -> tuple[int | None, tuple[int, ...]]:
    """Return the index of the reference's input, and those of the inputs that carry the states."""
    table, names = request.table, [wire.name for wire in request.inputs]

    def place(name: object, key: str) -> int:
        if name not in names:
            raise DesignError(f"controller.{key} names '{name}', which is no input; inputs: {', '.join(names)}")
        return names.index(str(name))

    reference = place(table["reference"], "reference") if "reference" in table else None
    if reference is None and "reference" in names:
        reference = names.index("reference")
    wires = tuple(k for k in range(len(names)) if k != reference)
    if "states" in table:
        given = table["states"]
        if not isinstance(given, list | tuple) or not given:
            raise DesignError(f'controller.states = {given!r} is not a list of names; write states = ["p_m", "v_m_s"]')
        wires = tuple(place(name, "states") for name in given)
    if len(wires) != len(plant.states):
        raise DesignError(
            f"nmpc needs one input a state, {len(plant.states)} ({', '.join(s.name for s in plant.states)}), but "
            f"{len(wires)} are given; name them in controller.states, in this order"
        )
    return reference, wires


def _slow(plant: Plant, ranges: list[Signal]) -> float:
    """Return a hundredth of the largest speed that the plant's friction sees."""
    state = next((b.state for b in plant.balances if b.kind in ("torque", "force") and b.state >= 0), 0)
    return max(abs(ranges[state].low), abs(ranges[state].high)) / 100


def _led(plant: Plant) -> int:
    """Return the state that is the plant's first output."""
    x, u = ca.SX.sym("x", len(plant.states)), ca.SX.sym("u", len(plant.inputs))
    reading = plant.reading(x, u, ca.DM([parameter.value for parameter in plant.parameters][: plant.rate.numel_in(2)]))
    for k in range(len(plant.states)):
        if ca.is_equal(ca.simplify(reading[0]), x[k]):
            return k
    raise DesignError(
        f"controller.reference leads the plant's first output, {plant.outputs[0].name}, which is no state of it; name "
        "a state first in plant.outputs"
    )


def _limits(request: Request, ranges: list[Signal]) -> tuple[Array, Array, Array, tuple[int, ...]]:
    """Read the limits of inputs and states, one over the span of each, and which states have any."""
    low, high = limits(request.table, request.outputs)
    free = [math.inf] * len(ranges)
    x_low = each(request.table, "x_min", [-x for x in free])
    x_high = each(request.table, "x_max", free)
    limited = []
    for k, (least, most) in enumerate(zip(x_low, x_high, strict=True)):
        if not least < most:
            raise DesignError(
                f"controller.x_min = {least:g} is not below x_max = {most:g} for {ranges[k].name}; no state keeps both"
            )
        if math.isfinite(least) or math.isfinite(most):
            limited.append(k)
    spans = [b - a for a, b in zip(low, high, strict=True)] + [ranges[k].high - ranges[k].low for k in limited]
    lows, highs = [*low, *(x_low[k] for k in limited)], [*high, *(x_high[k] for k in limited)]
    return np.array(lows), np.array(highs), 1 / np.array(spans), tuple(limited)


def _terminal(model: Law, target: Array, rest: Array, q: Array, r: Array) -> Array:
    """Return the Riccati solution at the target; Q where there is none."""
    n = len(q)
    slopes = np.array(model.last.function([], np.concatenate([target, rest]))[1]).ravel()[n:].reshape(n, -1)
    try:
        found = np.asarray(scipy.linalg.solve_discrete_are(slopes[:, :n], slopes[:, n:], q, r))
    except (np.linalg.LinAlgError, ValueError):
        return q
    return np.asarray((found + found.T) / 2)


def _law(request: Request, setup: NmpcSetup) -> Law:
    horizon, (n, m) = setup.horizon, (len(setup.target), len(request.outputs))
    planned = _planned(request, setup)
    check_names(request, [signal.name for signal in planned])
    z = symbols([wire.name for wire in request.inputs])
    x = symbols([signal.name for signal in planned])
    target = [ca.SX(t) for t in setup.target]
    if setup.reference is not None:
        target[setup.led] = z[setup.reference]
    plan = [ca.SX(0)] * m
    if setup.warm:
        led, moved = x[m + 1 : m + 1 + n * _kept(horizon)], x[m + 1 + n * _kept(horizon) :]
        twice = horizon.length - _kept(horizon)
        plan = [*x[: m + 1], *led, *led[-n:] * twice, *moved, *moved[-m:] * twice]
    parameters = ca.vertcat(*(z[k] for k in setup.wires), *target, *plan)
    results = symbols([f"result_{k}" for k in range(horizon.results)])
    capped, infeasible = ca.SX.sym("capped"), ca.SX.sym("infeasible")
    outputs = [ca.fmin(ca.fmax(u, horizon.low[k]), horizon.high[k]) for k, u in enumerate(results[:m])]
    states, moves = results[m + 2 :][: n * _kept(horizon)], results[m + 2 + n * horizon.length :]
    kept = [
        ca.fmin(ca.fmax(value, signal.low), signal.high)
        for value, signal in zip((results[m], *states, *moves), planned[m:], strict=False)
    ]
    flags = ca.vertcat(capped, infeasible, results[m + 1] > UNSETTLED)
    everything = [ca.vertcat(*x), ca.vertcat(*z)]
    stage = ca.Function(
        "law",
        [*everything, ca.vertcat(*results, capped, infeasible)],
        [
            ca.densify(ca.vertcat(*outputs, *kept)) if setup.warm else ca.SX(0, 1),
            ca.densify(ca.vertcat(*outputs)),
            flags,
            ca.SX(0, 1),
        ],
    )
    missed = f" (not for {', '.join(setup.plant.missed)})" if setup.plant.missed else ""
    return Law(
        name=request.name,
        says=f"nonlinear MPC over {horizon.length} samples, {n} states measured, {horizon.iterations} "
        f"Gauss-Newton step{'s' if horizon.iterations > 1 else ''} a sample{missed}",
        period=request.period,
        inputs=request.inputs,
        outputs=request.outputs,
        state=planned if setup.warm else (),
        start=(0.0,) * len(planned) if setup.warm else (),
        why=(PLAN_WHY,) * len(planned) if setup.warm else (),
        flags=(
            Flag("capped", "the step was cut short; the output is that without limits, limited"),
            Flag("infeasible", "no moves keep every limit; the output is that without limits, limited"),
            Flag("unsettled", "the step changed a move by more than a hundredth of its range: not optimal yet"),
        ),
        stages=(Solve(ca.Function("parameters", everything, [ca.densify(parameters)]), horizon), Scalar(stage, ())),
        states=setup.wires,
    )


def _kept(horizon: Horizon) -> int:
    """Return how many samples of a plan the law keeps: moved up by one, its last state and moves stand there twice."""
    return max(1, horizon.length - 1)


def _planned(request: Request, setup: NmpcSetup) -> tuple[Signal, ...]:
    """Name all that the law keeps: the last outputs, whether there is a plan, and its states and moves."""
    ranges = [request.inputs[k] for k in setup.wires]
    m, horizon = len(request.outputs), setup.horizon
    plan = []
    for k in range(1, _kept(horizon) + 1):
        for i, wire in enumerate(ranges, 1):
            middle, half = (wire.low + wire.high) / 2, WIDER * (wire.high - wire.low) / 2
            low, high = min(middle - half, 0.0), max(middle + half, 0.0)
            plan.append(Signal(f"plan_x_{k}_{i}", wire.unit, low, high))

    def limited(name: str, i: int) -> Signal:
        low, high = float(horizon.low[i]), float(horizon.high[i])
        return Signal(name, request.outputs[i].unit, min(low, 0.0), max(high, 0.0))

    for k in range(_kept(horizon)):
        plan += [limited(f"plan_u_{k}_{i + 1}", i) for i in range(m)]
    last = [limited(f"last_{i + 1}", i) for i in range(m)]
    return (*last, Signal("planned", "1", 0.0, 1.0), *plan)


PENDULUM = make_ode(
    {
        "states": ["angle_rad", "speed_rad_s"],
        "inputs": ["torque_N_m"],
        "outputs": {"angle_rad": "angle_rad", "speed_rad_s": "speed_rad_s"},
        "derivatives": {
            "angle_rad": "speed_rad_s",
            "speed_rad_s": "10*torque_N_m - 20*sin(angle_rad) - 0.5*speed_rad_s",
        },
    }
)

KIND = Kind(
    name="nmpc",
    says="nonlinear model predictive control: one Gauss-Newton step of the plant's own equations in every sample",
    design=design,
    example=Request(
        name="pendulum_nmpc",
        table={
            "Q": [5.0, 0.2],
            "R": 2.0,
            "P": [20.0, 1.0],
            "horizon": 5,
            "target": [0.5, 0.0],
            "u_target": [0.9588510772],
            "x_max": [math.inf, 2.5],
            "warm_start": False,
            "iterations": 1,
        },
        period=0.05,
        inputs=(Signal("angle", "rad", -0.6, 1.2), Signal("speed", "rad/s", -3.0, 3.0)),
        outputs=(Signal("output", "N*m", -0.5, 1.8),),
        plant=PENDULUM,
    ),
)

"""Linear model predictive control: the moves that cost least over the horizon and keep every limit, found each sample.

    min 1/2 sum x'Qx + u'Ru + 1/2 x[N]'P x[N],   u_min <= u <= u_max,   x_min <= x[1..N] <= x_max

for x[k+1] = A x[k] + B u[k], discrete. The states are eliminated, the rest is a quadratic program with constant data in
every sample (`condense.py`). Keys beside those:

- `states` names the inputs that carry x[0]; without it they are all inputs but the reference, in order.
- `blocks`: samples for which each move is held, in sum `horizon`; without it every sample has its own move.
- `x_soft`, a number or one a state: the limits of the states may be passed, at a cost of 1/2 x_soft excess^2 a sample.
- `du_min`, `du_max`: limits of the change of u from sample to sample, the last one applied included.
- `reference` names an input: the first output of the model (C x; without C the first state) is led there, and x and u
  are weighed as distances from the rest that belongs to it.
- `disturbances` names inputs that carry known disturbances d, `E` how they enter: x[k+1] = A x[k] + B u[k] + E d[k].
- `preview`: reference and known disturbances are given so many samples before they are due, and the controller keeps
  those on their way; the horizon sees them coming. Until the first one given is due they are taken for 0, or the end
  of their range next to it. Without it each is due in the sample that gives it, and is expected to stay.
- `delay_periods`: u acts so many samples later; the state is predicted up to there from the outputs on their way.
- `observer = "kalman"` with `process_noise`, `measurement_noise`, or "luenberger" with `observer_poles`: the inputs
  other than the reference are then measurements of C x, in order.
- `offset_free = true`: a constant disturbance at the plant's input is estimated and met; `disturbance_noise` is the
  variance of its change in a sample.
- `budget`: the work that one search may take before it is cut short (`quantize/twins/qp.py` says how it is
counted);
  without it the worst over the ranges in [signals] and some more. The output is then the second move of the last
  sample's plan, or the saturated LQR's where that sample had none either, and the status says `capped`; likewise
  `infeasible` where no moves keep every limit, which happens only with hard limits of states.
- `solver = "explicit"`: the moves as affine laws, one a region of the parameters, in a table that a binary search
  reads (`design/quadratic/partition.py`, `design/quadratic/tree.py`); for few moves and states.
- `solver = "fixed_iterations"`: the same number of iterations in every sample, in floating or fixed point
  (`design/quadratic/splitting.py`). It is chosen such that every output is within `accuracy`, a share of its range, of
  the optimum wherever there is one; judged by states drawn over the ranges in [signals]. It is for what "explicit" has
  no room for, on targets without a floating-point unit or where every sample has to take the same time: of a small
  servo `python -m bench.mpc.methods` counts 5,431 instructions in fixed32 against 112 of "explicit", and 1,561 of
  "online", which is exact, in float32.
- `solver = "auto"`: "explicit" where that is smaller than the search, else "online".
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import casadi as ca
import numpy as np
import numpy.typing as npt

from firmloop.design.design import Design, Kind, Request
from firmloop.design.kinds.mpc.method import FLAGS, with_method
from firmloop.design.kinds.mpc.predict import prediction_of, seen_samples
from firmloop.design.kinds.mpc.read import KEYS, MpcSetup, setup_of, whole
from firmloop.design.law import Flag, Law, Scalar, Solve
from firmloop.design.linear.linear_law import check_names, symbols, weighted_sum
from firmloop.design.linear.reach import reach, widened
from firmloop.design.quadratic.condense import Condensed, Prediction, check_feasible, condense, eliminate
from firmloop.design.table import check_keys, choice
from firmloop.identify.signal import Signal

Array = npt.NDArray[np.float64]

TOLD_WHY = "an input of a sample before"
NEXT_WHY = "a move that keeps its limits, or 0"
PAST_WHY = "an output of a sample before, which is limited"
ESTIMATE_WHY = "L1 norm from the limited output and the measurements through the observer, which forgets"


def design(request: Request) -> Design:
    """Condense the problem and write the law."""
    check_keys(request.table, KEYS, "an mpc")
    solver = choice(request.table, "solver", "online", tuple(FLAGS))
    setup = setup_of(request)
    prediction = prediction_of(request, setup)
    condensed = condense(prediction, setup.limits)
    _check_feasible(request, setup, condensed)
    budget = whole(request.table, "budget", 0, 0, 1_000_000)
    figures = {
        "rows": float(len(condensed.low)),
        "moves": float(len(condensed.h)),
        "condition": float(np.linalg.cond(condensed.h)),
    }

    def built(searched: bool) -> Law:
        own = replace(setup, second=_second(prediction, searched))
        problem = eliminate(condensed, budget, prediction.b.shape[1] + (own.second or 0))
        return _law(request, own, Solve(_parameters(request, own), problem), FLAGS[solver])

    law, more = with_method(built, request.table, solver, request.optimum)
    return Design(law, figures | more, None, {})


def _second(prediction: Prediction, searched: bool) -> int | None:
    """Return the place of the moves of the next sample in the plan; None where they are not kept."""
    held = len(prediction.blocks) == 1 or prediction.blocks[0] > 1
    return (0 if held else prediction.b.shape[1]) if searched else None


def _check_feasible(request: Request, setup: MpcSetup, condensed: Condensed) -> None:
    """Look for parameters within the ranges of the signals; an estimate has no range of its own."""
    n, m = setup.model.b.shape
    measured = setup.correction is None and setup.delay == 0
    wires = [request.inputs[k] for k in setup.measured] if measured else []
    low, high = np.full(condensed.s.shape[1], -np.inf), np.full(condensed.s.shape[1], np.inf)
    low[: len(wires)], high[: len(wires)] = [w.low for w in wires], [w.high for w in wires]
    if setup.rated:
        low[n : n + m], high[n : n + m] = setup.limits.u_low, setup.limits.u_high
    told = [request.inputs[place] for place in setup.told for _ in seen_samples(setup, place)]
    if told:
        low[-len(told) :], high[-len(told) :] = [w.low for w in told], [w.high for w in told]
    check_feasible(condensed, low, high)


def _past_names(request: Request, setup: MpcSetup) -> list[str]:
    """Names of the kept outputs, newest first, output by output."""
    depth = max(setup.delay, 1 if setup.rated else 0)
    single = len(request.outputs) == 1
    return [
        f"past_{k}" if single else f"past_{k}_{j}" for k in range(1, depth + 1) for j in range(len(request.outputs))
    ]


def _coming_names(request: Request, setup: MpcSetup) -> list[str]:
    """Names of the told signals' samples on their way, signal by signal, the one that is due first."""
    return [f"{request.inputs[place].name}_in_{k}" for place in setup.told for k in range(setup.preview)]


def _next_names(request: Request, setup: MpcSetup) -> list[str]:
    """Names of the kept moves of the next sample, and of whether they are any."""
    if setup.second is None:
        return []
    return [*(f"next_{wire.name}" for wire in request.outputs), "planned"]


def _estimate_names(setup: MpcSetup) -> list[str]:
    if setup.correction is None:
        return []
    states = [f"estimate_{k}" for k in range(1, len(setup.model.a) + 1)]
    drives = setup.model.b.shape[1]
    return states + ([f"disturbance_{k}" for k in range(1, drives + 1)] if setup.disturbed else [])


@dataclass(frozen=True, slots=True)
class MpcWires:
    """Symbols of one sample: inputs, estimates, disturbances, the kept outputs [newest first][output], and the rest.

    `coming` are the samples of each told signal [signal][the one that is due first], the input itself the last;
    `following` are the moves that the last plan had for this sample, and whether there was one.
    """

    z: tuple[ca.SX, ...]
    estimate: tuple[ca.SX, ...]
    disturbance: tuple[ca.SX, ...]
    past: tuple[tuple[ca.SX, ...], ...]
    coming: tuple[tuple[ca.SX, ...], ...]
    following: tuple[ca.SX, ...]

    @property
    def x(self) -> ca.SX:
        """The law's state."""
        past, coming = (u for outputs in self.past for u in outputs), (r for row in self.coming for r in row[:-1])
        return ca.vertcat(*self.estimate, *self.disturbance, *past, *coming, *self.following)


def _wires(request: Request, setup: MpcSetup) -> MpcWires:
    n, m = setup.model.b.shape
    held, past = symbols(_estimate_names(setup)), symbols(_past_names(request, setup))
    rows = tuple(past[k : k + m] for k in range(0, len(past), m))
    z, ahead = symbols([w.name for w in request.inputs]), symbols(_coming_names(request, setup))
    coming = tuple(
        (*ahead[k * setup.preview : (k + 1) * setup.preview], z[place]) for k, place in enumerate(setup.told)
    )
    return MpcWires(z, held[:n], held[n:], rows, coming, symbols(_next_names(request, setup)))


def _parameters(request: Request, setup: MpcSetup) -> ca.Function:
    """(x, z) -> the parameters: the state when the output will act, then the rest."""
    wires, model = _wires(request, setup), setup.model
    state = wires.estimate or tuple(wires.z[k] for k in setup.measured)
    terms, factors = list(state), np.eye(len(model.a))
    for k in range(setup.delay):  # the oldest output acts first
        acting = wires.past[setup.delay - 1 - k]
        factors = np.hstack([model.a @ factors, model.b])
        terms += acting
        if wires.disturbance:
            factors = np.hstack([factors, model.b])
            terms += wires.disturbance
        factors = np.hstack([factors, setup.entry])
        terms += [row[min(k, setup.preview)] for row in _known(setup, wires)]
    parameters = [weighted_sum(list(row), terms) for row in factors]
    if setup.rated:
        parameters += wires.past[0]
    parameters += wires.disturbance
    for place, row in zip(setup.told, wires.coming, strict=True):
        parameters += [row[k] for k in seen_samples(setup, place)]
    return ca.Function("parameters", [wires.x, ca.vertcat(*wires.z)], [ca.densify(ca.vertcat(*parameters))])


def _known(setup: MpcSetup, wires: MpcWires) -> tuple[tuple[ca.SX, ...], ...]:
    """Return the samples of the known disturbances, as `MpcWires.coming` has them."""
    return wires.coming[len(setup.told) - len(setup.known) :]


def _law(request: Request, setup: MpcSetup, solve: Solve, flags: tuple[Flag, ...]) -> Law:
    wires, model, bounds = _wires(request, setup), setup.model, setup.limits
    m = model.b.shape[1]
    capped, infeasible = ca.SX.sym("capped"), ca.SX.sym("infeasible")
    moves = symbols([f"move_{k}" for k in range(solve.quadratic.results)])
    failed = ca.logic_or(capped, infeasible)
    told, outputs = {"capped": capped, "infeasible": infeasible}, []
    if solve.quadratic.feasible and flags == FLAGS["online"]:  # roundings alone say that there are none
        told = {"capped": failed, "infeasible": ca.SX(0)}
    for k, move in enumerate(moves[:m]):
        if wires.following:
            move = ca.if_else(ca.logic_and(failed, wires.following[-1] > 0.5), wires.following[k], move)
        if setup.rated:
            move = ca.fmin(ca.fmax(move, wires.past[0][k] + bounds.du_low[k]), wires.past[0][k] + bounds.du_high[k])
        outputs.append(ca.fmin(ca.fmax(move, bounds.u_low[k]), bounds.u_high[k]))
    acting = wires.past[setup.delay - 1] if setup.delay else tuple(outputs)
    after = _observed(setup, wires, acting)
    kept = [*outputs, *(u for row in wires.past[:-1] for u in row)] if wires.past else []
    kept += [r for row in wires.coming for r in row[1:]] if setup.preview else []
    if setup.second is not None:
        kept += [ca.if_else(failed, 0.0, move) for move in moves[setup.second :]] + [ca.if_else(failed, 0.0, 1.0)]
    names = [*_estimate_names(setup), *_past_names(request, setup), *_coming_names(request, setup)]
    names += _next_names(request, setup)
    check_names(request, names)
    stage = ca.Function(
        "law",
        [wires.x, ca.vertcat(*wires.z), ca.vertcat(*moves, capped, infeasible)],
        [
            ca.densify(ca.vertcat(*after, *kept)),
            ca.densify(ca.vertcat(*outputs)),
            ca.vertcat(*(told[flag.name] for flag in flags)),
            ca.SX(0, 1),
        ],
    )
    ranges = _ranges(request, setup)
    law = Law(
        name=request.name,
        says=_says(request, setup, solve),
        period=request.period,
        inputs=request.inputs,
        outputs=request.outputs,
        state=tuple(signal for signal, _ in ranges),
        start=tuple(min(max(0.0, signal.low), signal.high) for signal, _ in ranges),
        why=tuple(why for _, why in ranges),
        flags=flags,
        stages=(solve, Scalar(stage, ())),
    )
    if np.array_equal(setup.seen, np.eye(setup.model.order)):
        return replace(law, states=setup.measured)
    return replace(law, watched=setup.measured)


def _observed(setup: MpcSetup, wires: MpcWires, acting: tuple[ca.SX, ...]) -> list[ca.SX]:
    """Return estimates and disturbances of the next sample."""
    if setup.correction is None:
        return []
    model = setup.model
    error = [
        wires.z[place] - weighted_sum(row, wires.estimate)
        for row, place in zip(setup.seen, setup.measured, strict=True)
    ]
    driven = [u + d for u, d in zip(acting, wires.disturbance, strict=True)] if wires.disturbance else list(acting)
    due = [row[0] for row in _known(setup, wires)]
    n = len(model.a)
    found = [
        weighted_sum(
            [*model.a[k], *model.b[k], *setup.entry[k], *setup.correction[k]],
            [*wires.estimate, *driven, *due, *error],
        )
        for k in range(n)
    ]
    return found + [d + weighted_sum(setup.correction[n + k], error) for k, d in enumerate(wires.disturbance)]


def _ranges(request: Request, setup: MpcSetup) -> list[tuple[Signal, str]]:
    """Bound the estimates by the L1 norm from u and y, the kept outputs by the limits of u."""
    model, bounds, ranges = setup.model, setup.limits, []
    n, m = model.b.shape
    if setup.correction is not None:
        drives = m if setup.disturbed else 0
        a = np.block([[model.a, model.b[:, :drives]], [np.zeros((drives, n)), np.eye(drives)]])
        seen = np.hstack([setup.seen, np.zeros((len(setup.seen), drives))])
        entry = np.hstack([model.b, setup.entry])
        drive = np.hstack([np.vstack([entry, np.zeros((drives, entry.shape[1]))]), setup.correction])
        wires = [request.inputs[k] for k in (*setup.known, *setup.measured)]
        low = np.append(bounds.u_low, [w.low for w in wires])
        high = np.append(bounds.u_high, [w.high for w in wires])
        ends = reach(a - setup.correction @ seen, drive, low, high)
        units = [*model.units, *(wire.unit for wire in request.outputs)]
        ranges += [
            (widened(name, unit, float(down), float(up)), ESTIMATE_WHY)
            for name, unit, down, up in zip(_estimate_names(setup), units, *ends, strict=False)
        ]
    for k, name in enumerate(_past_names(request, setup)):
        down, up = float(bounds.u_low[k % m]), float(bounds.u_high[k % m])
        ranges.append((Signal(name, request.outputs[k % m].unit, min(down, 0.0), max(up, 0.0)), PAST_WHY))
    for k, name in enumerate(_coming_names(request, setup)):
        ranges.append((replace(request.inputs[setup.told[k // setup.preview]], name=name), TOLD_WHY))
    for k, name in enumerate(_next_names(request, setup)[:-1]):
        down, up = min(float(bounds.u_low[k]), 0.0), max(float(bounds.u_high[k]), 0.0)
        ranges.append((widened(name, request.outputs[k].unit, down, up), NEXT_WHY))
    if setup.second is not None:
        ranges.append((Signal("planned", "1", 0.0, 1.0), "1 or 0"))
    return ranges


def _says(request: Request, setup: MpcSetup, solve: Solve) -> str:
    seen = "states measured" if setup.correction is None else "states estimated"
    extra = ", offset-free" if setup.disturbed else ""
    return (
        f"linear MPC over {setup.horizon} samples, {setup.model.order} {seen}{extra}: {len(solve.quadratic.low)} limits"
    )


KIND = Kind(
    name="mpc",
    says="linear model predictive control: a quadratic program in every sample",
    design=design,
    example=Request(
        name="cart_mpc",
        table={
            "A": [[1.0, 0.02, 0.0], [0.0, 0.96, 0.3], [0.0, -0.1, 0.7]],
            "B": [[0.0], [0.01], [0.05]],
            "Q": [40.0, 1.0, 0.1],
            "R": 0.02,
            "horizon": 8,
            "u_min": -6.0,
            "u_max": 6.0,
            "x_max": [float("inf"), 0.5, float("inf")],
            "x_min": [-float("inf"), -0.5, -float("inf")],
        },
        period=0.02,
        inputs=(
            Signal("position", "m", -0.5, 0.5),
            Signal("speed", "m/s", -0.45, 0.45),
            Signal("current", "A", -0.3, 0.3),
        ),
        outputs=(Signal("output", "V", -6.0, 6.0),),
        plant=None,
    ),
)

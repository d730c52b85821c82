"""State feedback: u = -K x + N r, with x measured or estimated, and integral action on request.

    v = -K x + N r + I,    u = min(max(v, u_min), u_max)
    x+ = A x + B u + L (y - C x)                    where x is estimated (predictor form)
    I+ = I + ki h (r - y), unless v is beyond a limit and ki (r - y) points further out

The model A, B, C is the table's (discrete, rows) or the project's plant at rest behind a zero-order hold; the inputs
that its delay keeps are known and stand behind its own states. Keys:

- `K`, one row an output, or the weights `Q` (states) and `R` (outputs) of an LQR: a number, a diagonal or a matrix.
- `observer = "luenberger"` with `observer_poles` (real, in z), or "kalman" with `process_noise` and `measurement_noise`
  (covariances, the forms of Q): then the inputs other than `reference` are measurements, matched by name with the
  plant's outputs, else in order. Without an observer they are the states, in order (`states` names them).
- `integral_weight` (with Q, weight of the summed error h (r - y)) or `ki` (with K).
- `reference_gain` in place of the N that leaves no error at rest; `u_min`, `u_max`.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np
import numpy.typing as npt

from firmloop.design.design import Design, Kind, Request
from firmloop.design.draft import Draft, Element
from firmloop.design.kinds.feedback_gains import OBSERVERS, FeedbackGains, find_gains
from firmloop.design.law import DesignError, Law
from firmloop.design.linear.linear_law import INTEGRAL_WHY, check_names, symbols, weighted_sum, write
from firmloop.design.linear.reach import reach, widened
from firmloop.design.models.model import Model, model_of
from firmloop.design.table import check_keys, choice, limits
from firmloop.identify.signal import Signal

Array = npt.NDArray[np.float64]

KEYS = (
    *("K", "Q", "R", "A", "B", "C", "observer", "observer_poles", "process_noise", "measurement_noise", "states"),
    *("integral_weight", "ki", "reference_gain", "u_min", "u_max"),
)
ESTIMATE_WHY = "L1 norm from the limited output and the measurements through the observer, which forgets"


def design(request: Request) -> Design:
    """Find the gains and write the law."""
    check_keys(request.table, KEYS, "a state_feedback")
    if not request.outputs or not request.inputs:
        raise DesignError("controller.kind = 'state_feedback' needs inputs and an output in [signals]")
    gains, model = find_gains(request, model_of(request))
    return Design(_law(request, model, gains), _figures(gains), None, {})


def draft(request: Request) -> Draft:
    """Find the gains and write the equations; the limited outputs move the observer, the error an integral."""
    check_keys(request.table, KEYS, "a state_feedback")
    gains, model = find_gains(request, model_of(request))
    parts = _parts(request, model, gains)
    applied = symbols([f"{wire.name}_applied" for wire in request.outputs])
    units = [*model.units, *([wire.unit for wire in request.outputs] * len(model.a))][parts.first :]
    state = (
        Element(symbol.name(), unit, symbol, after)
        for symbol, unit, after in zip(parts.held, units, parts.moved(applied), strict=False)
    )
    return Draft(
        _says(request, model, gains),
        parts.z,
        tuple(state),
        parts.sums,
        parts.named,
        _figures(gains),
        applied,
        (gains.ki * request.period) * parts.error if gains.ki else None,
        () if gains.correction is not None else gains.measured,
    )


def _figures(gains: FeedbackGains) -> dict[str, float]:
    figures = {f"K_{i}_{j}": float(gains.feedback[i, j]) for i, j in np.ndindex(*gains.feedback.shape)}
    if gains.reference is not None:
        figures |= {f"N_{i}": float(value) for i, value in enumerate(gains.forward)}
    if gains.ki:
        figures["ki"] = gains.ki
    if gains.correction is not None:
        figures |= {f"L_{i}_{j}": float(gains.correction[i, j]) for i, j in np.ndindex(*gains.correction.shape)}
    return figures


@dataclass(frozen=True, slots=True)
class _Parts:
    """The equations before anything is limited."""

    z: tuple[ca.SX, ...]
    first: int  # of the model's states that the controller keeps
    held: tuple[ca.SX, ...]
    sums: tuple[ca.SX, ...]  # -K x + N r
    error: ca.SX  # r - y of the integral
    moved: Callable[[Sequence[ca.SX]], list[ca.SX]]  # what `held` is next, by the limited outputs
    named: Mapping[str, tuple[str, ca.SX]]


def _parts(request: Request, model: Model, gains: FeedbackGains) -> _Parts:
    """Write -K x + N r, what the observer sees, and what it does with it."""
    z = symbols([wire.name for wire in request.inputs])
    seen = [z[k] for k in gains.measured]
    estimated = gains.correction is not None
    first = 0 if estimated else model.order  # without an observer the own states are inputs, not state
    held = symbols(_state_names(model)[first:])
    x = [*([] if estimated else seen), *held]
    r = z[gains.reference] if gains.reference is not None else ca.SX(0)
    sums = [weighted_sum([*(-row), n], [*x, r]) for row, n in zip(gains.feedback, gains.forward, strict=True)]
    named: dict[str, tuple[str, ca.SX]] = {}
    wrong: list[ca.SX] = []
    if gains.correction is not None:
        wrong = [y - weighted_sum(row, x) for y, row in zip(seen, model.c, strict=True)]
        units = [request.inputs[k].unit for k in gains.measured]
        named |= {f"innovation_{k}": (unit, e) for k, (unit, e) in enumerate(zip(units, wrong, strict=True), 1)}
    correction = gains.correction if gains.correction is not None else np.zeros((len(model.a), 0))

    def moved(applied: Sequence[ca.SX]) -> list[ca.SX]:
        return [
            weighted_sum([*model.a[k], *model.b[k], *correction[k]], [*x, *applied, *wrong])
            for k in range(first, len(model.a))
        ]

    error = ca.SX(0)
    if gains.ki:
        error = r - (seen[0] if estimated else weighted_sum(model.c[0], x))
        named["error"] = (request.inputs[gains.measured[0]].unit if estimated else "", error)
    return _Parts(z, first, held, tuple(sums), error, moved, named)


def _law(request: Request, model: Model, gains: FeedbackGains) -> Law:
    """Write the equations of the module docstring."""
    low, high = limits(request.table, request.outputs)
    parts = _parts(request, model, gains)
    integral = ca.SX.sym("integral")
    free = [parts.sums[0] + integral] if gains.ki else list(parts.sums)
    limited = [ca.fmin(ca.fmax(v, a), b) for v, a, b in zip(free, low, high, strict=True)]
    ends = ["unlimited"] if len(free) == 1 else [f"{wire.name}_unlimited" for wire in request.outputs]
    named = {end: (wire.unit, v) for end, wire, v in zip(ends, request.outputs, free, strict=True)}
    named |= parts.named
    state = list(zip(parts.held, parts.moved(limited), strict=True))
    ranges = _ranges(request, model, gains, parts.first, (low, high))
    if gains.ki:
        error = parts.error
        up, down = (error > 0, error < 0) if gains.ki > 0 else (error < 0, error > 0)
        outward = ca.logic_or(ca.logic_and(free[0] > high[0], up), ca.logic_and(free[0] < low[0], down))
        step = (gains.ki * request.period) * error
        state.append((integral, integral + ca.if_else(ca.logic_not(outward), step, 0)))
        ranges.append(_integral_range(request, model, gains, [s for s, _ in ranges], (low[0], high[0])))
    check_names(request, [*(symbol.name() for symbol, _ in state), *named])
    pairs = list(zip(limited, free, strict=True))
    law = write(request, _says(request, model, gains), parts.z, state, ranges, pairs, named)
    if gains.correction is None:
        return replace(law, states=gains.measured)
    plant = [] if request.plant is None or "A" in request.table else [each.name for each in request.plant.outputs]
    rows = tuple(plant.index(name) for name in model.outputs if name in plant)
    return replace(law, watched=gains.measured, watched_outputs=rows if len(rows) == len(gains.measured) else ())


def _ranges(
    request: Request, model: Model, gains: FeedbackGains, first: int, limit: tuple[tuple[float, ...], tuple[float, ...]]
) -> list[tuple[Signal, str]]:
    """Bound the estimate by the L1 norm from u and y; the past inputs by the limits of u, likewise."""
    estimated = gains.correction is not None
    drive, inner = model.b, model.a
    low, high = np.array(limit[0]), np.array(limit[1])
    wires = [request.inputs[k] for k in gains.measured]
    if gains.correction is not None:
        inner = model.a - gains.correction @ model.c
        drive = np.hstack([model.b, gains.correction])
        low, high = np.append(low, [w.low for w in wires]), np.append(high, [w.high for w in wires])
    least, most = reach(inner[first:, first:], drive[first:], low, high)
    units = [*model.units, *([wire.unit for wire in request.outputs] * len(model.a))]
    why = ESTIMATE_WHY if estimated else "an output of a sample before, which is limited"
    return [
        (widened(name, units[k], float(down), float(up)), why)
        for k, (name, down, up) in enumerate(zip(_state_names(model)[first:], least, most, strict=True), first)
    ]


def _integral_range(
    request: Request, model: Model, gains: FeedbackGains, held: list[Signal], limit: tuple[float, float]
) -> tuple[Signal, str]:
    """I grows only while v <= u_max: then I <= u_max less the least of -K x + N r, and one step more."""
    wires = [request.inputs[k] for k in gains.measured]
    estimated = gains.correction is not None
    terms = [*zip(-gains.feedback[0], [*([] if estimated else wires), *held], strict=True)]
    assert gains.reference is not None, "integral action has a reference"
    r = request.inputs[gains.reference]
    terms.append((float(gains.forward[0]), r))
    rest_low = sum(min(k * s.low, k * s.high) for k, s in terms)
    rest_high = sum(max(k * s.low, k * s.high) for k, s in terms)
    seen = [(1.0, wires[0])] if estimated else [*zip(model.c[0], [*wires, *held], strict=True)]
    y_low = sum(min(k * s.low, k * s.high) for k, s in seen)
    y_high = sum(max(k * s.low, k * s.high) for k, s in seen)
    step = abs(gains.ki) * request.period * max(r.high - y_low, y_high - r.low, 0.0)
    low, high = min(0.0, limit[0] - rest_high - step), max(0.0, limit[1] - rest_low + step)
    return widened("integral", request.outputs[0].unit, float(low), float(high)), INTEGRAL_WHY


def _state_names(model: Model) -> list[str]:
    """C names of the estimates, then of the past inputs, newest first."""
    names: list[str] = []
    for name in model.names:
        plain = re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_")[:26].rstrip("_")
        names.append(
            f"{plain}_est" if f"{plain}_est" not in names and plain[:1].isalpha() else f"estimate_{len(names)}"
        )
    return names + [f"past_{k}" for k in range(1, len(model.a) - model.order + 1)]


def _says(request: Request, model: Model, gains: FeedbackGains) -> str:
    how = "LQR" if "Q" in request.table else "state feedback"
    observer = choice(request.table, "observer", "none", OBSERVERS)
    seen = {"none": "states measured", "luenberger": "Luenberger observer", "kalman": "Kalman filter"}[observer]
    extra = ", integral action" if gains.ki else ""
    return f"{how}, {seen}{extra}: {model.order} states, K " + " ".join(f"{k:.6g}" for k in gains.feedback.ravel())


KIND = Kind(
    name="state_feedback",
    says="u = -K x + N r from given gains or LQR weights, the state measured or estimated",
    design=design,
    draft=draft,
    example=Request(
        name="cart_lqg",
        table={
            "A": [[1.0, 0.009, 0.0], [0.0, 0.82, 0.35], [0.0, -0.12, 0.64]],
            "B": [[0.0], [0.02], [0.11]],
            "C": [[1.0, 0.0, 0.0]],
            "Q": [400.0, 0.1, 0.01],
            "R": 0.05,
            "integral_weight": 900.0,
            "observer": "kalman",
            "process_noise": [1e-6, 1e-3, 1e-2],
            "measurement_noise": 1e-5,
        },
        period=0.01,
        inputs=(Signal("reference", "m", -0.4, 0.4), Signal("measurement", "m", -0.5, 0.5)),
        outputs=(Signal("output", "V", -12.0, 12.0),),
        plant=None,
    ),
)

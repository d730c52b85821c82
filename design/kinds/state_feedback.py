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
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np
import numpy.typing as npt

from design.kinds import Design, Kind, Request
from design.law import DesignError, Law
from design.linear_law import check_names, symbols, weighted_sum, write
from design.model import Model, model_of, weights
from design.reach import reach, widened
from design.regulator import check_stable, kalman, lqr, luenberger, reference_gain
from design.table import check_keys, choice, each, limits, matrix, numbers, real
from identify.signal import Signal

Array = npt.NDArray[np.float64]

OBSERVERS = ("none", "luenberger", "kalman")
KEYS = (
    *("K", "Q", "R", "A", "B", "C", "observer", "observer_poles", "process_noise", "measurement_noise", "states"),
    *("integral_weight", "ki", "reference_gain", "u_min", "u_max"),
)
ESTIMATE_WHY = "L1 norm from the limited output and the measurements through the observer, which forgets"
INTEGRAL_WHY = "it moves outward only while the unlimited output is within its limits, at most one step beyond"


@dataclass(frozen=True, slots=True)
class Gains:
    """Every constant of the law, and which inputs it reads; `feedback` (m, n), `forward` (m,), `correction` (n, r)."""

    feedback: Array
    forward: Array
    ki: float
    correction: Array | None  # L; None without an observer
    reference: int | None  # index of that input
    measured: tuple[int, ...]  # indices of the states, or of the measurements


def design(request: Request) -> Design:
    """Find the gains and write the law."""
    check_keys(request.table, KEYS, "a state_feedback")
    if not request.outputs or not request.inputs:
        raise DesignError("controller.kind = 'state_feedback' needs inputs and an output in [signals]")
    model = model_of(request)
    gains, model = _gains(request, model)
    figures = {f"K_{i}_{j}": float(gains.feedback[i, j]) for i, j in np.ndindex(*gains.feedback.shape)}
    if gains.reference is not None:
        figures |= {f"N_{i}": float(value) for i, value in enumerate(gains.forward)}
    if gains.ki:
        figures["ki"] = gains.ki
    if gains.correction is not None:
        figures |= {f"L_{i}_{j}": float(gains.correction[i, j]) for i, j in np.ndindex(*gains.correction.shape)}
    return Design(_law(request, model, gains), figures, None, {})


def _gains(request: Request, model: Model | None) -> tuple[Gains, Model]:
    table, drives = request.table, len(request.outputs)
    kind = choice(table, "observer", "none", OBSERVERS)
    names = [wire.name for wire in request.inputs]
    reference = names.index("reference") if "reference" in names else None
    others = [k for k in range(len(names)) if k != reference]
    if "states" in table:
        others = [_index(names, name) for name in _texts(table["states"])]
    if model is None:
        model = _gain_alone(request, kind, len(others))
    if kind == "none" and len(others) != model.order:
        raise DesignError(
            f"state_feedback without an observer needs one input a state, {model.order} ({', '.join(model.names)}), "
            f"but [signals] gives {len(others)}; add signals, or give controller.observer"
        )
    if kind != "none":
        model = _measured_by(model, [names[k] for k in others])
    feedback, ki = _feedback(request, model)
    forward = np.zeros(drives)
    if reference is not None:
        forward = (
            np.array(each(table, "reference_gain", [0.0] * drives))
            if "reference_gain" in table
            else reference_gain(model.a, model.b, model.c, feedback)
        )
    correction = _correction(request, model, kind)
    return Gains(feedback, forward, ki, correction, reference, tuple(others)), model


def _gain_alone(request: Request, kind: str, states: int) -> Model:
    """Stand in for a model where K is all there is: nothing is known, so nothing can be checked."""
    if kind != "none" or "Q" in request.table or "K" not in request.table:
        raise DesignError("state_feedback needs a model for this; add [plant], or A, B (and C) to [controller]")
    if "reference" in [wire.name for wire in request.inputs] and "reference_gain" not in request.table:
        raise DesignError(
            "controller.reference_gain is missing; without a model it cannot be computed: give it, or [plant]"
        )
    if "ki" in request.table:
        raise DesignError("controller.ki needs a model that says what is measured; add [plant], or A, B and C")
    still = np.zeros((states, states))
    names = tuple(f"x_{k}" for k in range(1, states + 1))
    return Model(still, np.zeros((states, len(request.outputs))), still, states, names, ("1",) * states, ())


def _measured_by(model: Model, names: list[str]) -> Model:
    """Keep the rows of C that the inputs carry, in the order of the inputs."""
    if not names or len(names) > len(model.outputs):
        raise DesignError(
            f"the observer has {len(names)} measurement(s) ({', '.join(names)}) of a model with {len(model.outputs)} "
            f"output(s) ({', '.join(model.outputs)}); correct [signals] or the model's outputs"
        )
    by_name = {output.lower(): k for k, output in enumerate(model.outputs)}
    rows = [by_name[name] for name in names] if all(name in by_name for name in names) else list(range(len(names)))
    outputs = tuple(model.outputs[k] for k in rows)
    return Model(model.a, model.b, model.c[rows], model.order, model.names, model.units, outputs)


def _feedback(request: Request, model: Model) -> tuple[Array, float]:
    """Return K (m, n), past inputs included, and ki."""
    table, drives, size = request.table, len(request.outputs), len(model.a)
    h = request.period
    for one, other in (("K", "Q"), ("K", "R"), ("ki", "Q"), ("integral_weight", "K")):
        if one in table and other in table:
            raise DesignError(f"controller.{one} is given beside {other}; remove one of the two")
    if ("ki" in table or "integral_weight" in table) and (
        drives != 1 or "reference" not in [wire.name for wire in request.inputs]
    ):
        raise DesignError(
            "integral action needs one output and an input named 'reference'; remove it or add the signal"
        )
    ring = np.block([[model.a, np.zeros((size, 1))], [-h * model.c[:1], np.ones((1, 1))]])
    drive = np.vstack([model.b, np.zeros((1, drives))])
    if "K" in table:
        given = matrix(table, "K", drives, None, "controller.outputs")
        if given.shape[1] not in (model.order, size):
            raise DesignError(
                f"controller.K has {given.shape[1]} columns for {model.order} states; correct one of them"
            )
        feedback = np.hstack([given, np.zeros((drives, size - given.shape[1]))])
        ki = real(table, "ki", 0.0)
        if np.any(model.b):
            whole = np.hstack([feedback, [[-ki]]]) if ki else feedback
            check_stable(ring - drive @ whole if ki else model.a - model.b @ feedback, "the loop of controller.K")
        return feedback, ki
    q = np.zeros((size, size))
    q[: model.order, : model.order] = weights(table, "Q", model.order, False)
    r = weights(table, "R", drives, True)
    weight = real(table, "integral_weight", 0.0, 0.0)
    if not weight:
        return lqr(model.a, model.b, q, r, "the weights Q and R"), 0.0
    full = np.block([[q, np.zeros((size, 1))], [np.zeros((1, size)), np.full((1, 1), weight)]])
    whole = lqr(ring, drive, full, r, "the weights Q, R and integral_weight")
    return whole[:, :size], float(-whole[0, size])


def _correction(request: Request, model: Model, kind: str) -> Array | None:
    """Return L (n, r); the past inputs are known and need none."""
    table, own = request.table, model.order
    keys = {"luenberger": ("observer_poles",), "kalman": ("process_noise", "measurement_noise"), "none": ()}
    for other in ("observer_poles", "process_noise", "measurement_noise"):
        if other in table and other not in keys[kind]:
            raise DesignError(
                f"controller.{other} has no use with observer = '{kind}'; remove it or change the observer"
            )
    if kind == "none":
        return None
    if kind == "luenberger":
        found = luenberger(model.a_own, model.c_own, numbers(table, "observer_poles", None))
    else:
        w, v = weights(table, "process_noise", own, False), weights(table, "measurement_noise", len(model.c), True)
        found = kalman(model.a_own, model.c_own, w, v)
    check_stable(model.a_own - found @ model.c_own, "the observer")
    return np.vstack([found, np.zeros((len(model.a) - own, len(model.c)))])


def _law(request: Request, model: Model, gains: Gains) -> Law:
    """Write the equations of the module docstring."""
    low, high = limits(request.table, request.outputs)
    z = symbols([wire.name for wire in request.inputs])
    seen = [z[k] for k in gains.measured]
    estimated = gains.correction is not None
    first = 0 if estimated else model.order  # without an observer the own states are inputs, not state
    held = symbols(_state_names(model)[first:])
    x = [*([] if estimated else seen), *held]
    named: dict[str, tuple[str, ca.SX]] = {}
    r = z[gains.reference] if gains.reference is not None else ca.SX(0)
    sums = [weighted_sum([*(-row), n], [*x, r]) for row, n in zip(gains.feedback, gains.forward, strict=True)]
    state: list[tuple[ca.SX, ca.SX]] = []
    free = list(sums)
    integral = ca.SX.sym("integral")
    if gains.ki:
        free = [sums[0] + integral]
    limited = [ca.fmin(ca.fmax(v, a), b) for v, a, b in zip(free, low, high, strict=True)]
    ends = ["unlimited"] if len(free) == 1 else [f"{wire.name}_unlimited" for wire in request.outputs]
    named |= {end: (wire.unit, v) for end, wire, v in zip(ends, request.outputs, free, strict=True)}
    wrong: list[ca.SX] = []
    if gains.correction is not None:
        wrong = [y - weighted_sum(row, x) for y, row in zip(seen, model.c, strict=True)]
        units = [request.inputs[k].unit for k in gains.measured]
        named |= {f"innovation_{k}": (unit, e) for k, (unit, e) in enumerate(zip(units, wrong, strict=True), 1)}
    correction = gains.correction if gains.correction is not None else np.zeros((len(model.a), 0))
    for k, symbol in enumerate(held, first):
        after = weighted_sum([*model.a[k], *model.b[k], *correction[k]], [*x, *limited, *wrong])
        state.append((symbol, after))
    ranges = _ranges(request, model, gains, first, (low, high))
    if gains.ki:
        y = seen[0] if estimated else weighted_sum(model.c[0], x)
        error = r - y
        named["error"] = (request.inputs[gains.measured[0]].unit if estimated else "", error)
        up, down = (error > 0, error < 0) if gains.ki > 0 else (error < 0, error > 0)
        outward = ca.logic_or(ca.logic_and(free[0] > high[0], up), ca.logic_and(free[0] < low[0], down))
        step = (gains.ki * request.period) * error
        state.append((integral, integral + ca.if_else(ca.logic_not(outward), step, 0)))
        ranges.append(_integral_range(request, model, gains, [s for s, _ in ranges], (low[0], high[0])))
    check_names(request, [*(symbol.name() for symbol, _ in state), *named])
    law = write(request, _says(request, model, gains), z, state, ranges, list(zip(limited, free, strict=True)), named)
    return law if estimated else replace(law, states=gains.measured)


def _ranges(
    request: Request, model: Model, gains: Gains, first: int, limit: tuple[tuple[float, ...], tuple[float, ...]]
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
    request: Request, model: Model, gains: Gains, held: list[Signal], limit: tuple[float, float]
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


def _says(request: Request, model: Model, gains: Gains) -> str:
    how = "LQR" if "Q" in request.table else "state feedback"
    observer = choice(request.table, "observer", "none", OBSERVERS)
    seen = {"none": "states measured", "luenberger": "Luenberger observer", "kalman": "Kalman filter"}[observer]
    extra = ", integral action" if gains.ki else ""
    return f"{how}, {seen}{extra}: {model.order} states, K " + " ".join(f"{k:.6g}" for k in gains.feedback.ravel())


def _texts(value: object) -> list[str]:
    if not isinstance(value, list | tuple) or not value or not all(isinstance(name, str) for name in value):
        raise DesignError(
            f'controller.states = {value!r} is not a list of names; write it like states = ["p_m", "v_m_s"]'
        )
    return [str(name) for name in value]


def _index(names: list[str], name: str) -> int:
    if name not in names:
        raise DesignError(f"controller.states names '{name}', which is no input; inputs: {', '.join(names)}")
    return names.index(name)


KIND = Kind(
    name="state_feedback",
    says="u = -K x + N r from given gains or LQR weights, the state measured or estimated",
    design=design,
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

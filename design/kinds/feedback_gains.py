"""Find every constant of a state feedback: K, N, ki and the observer's L, from the table and the model.

The keys are told in `state_feedback.py`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from firmloop.design.design import Request
from firmloop.design.law import DesignError
from firmloop.design.models.model import Model, weights
from firmloop.design.models.regulator import check_stable, kalman, lqr, luenberger, reference_gain
from firmloop.design.table import choice, each, matrix, numbers, real

Array = npt.NDArray[np.float64]

OBSERVERS = ("none", "luenberger", "kalman")


@dataclass(frozen=True, slots=True)
class FeedbackGains:
    """Every constant of the law, and which inputs it reads; `feedback` (m, n), `forward` (m,), `correction` (n, r)."""

    feedback: Array
    forward: Array
    ki: float
    correction: Array | None  # L; None without an observer
    reference: int | None  # index of that input
    measured: tuple[int, ...]  # indices of the states, or of the measurements


def find_gains(request: Request, model: Model | None) -> tuple[FeedbackGains, Model]:
    """Return them, and the model with the rows of C that are measured; None is no model."""
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
        others = _in_order(model, others, names)  # the first of them is what the reference is for
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
    return FeedbackGains(feedback, forward, ki, correction, reference, tuple(others)), model


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


def _in_order(model: Model, wires: list[int], names: list[str]) -> list[int]:
    """Return the inputs in the order of the model's outputs, where they are called as those are."""
    rows = _rows_called(model, [names[k] for k in wires])
    return wires if rows is None else [wire for _, wire in sorted(zip(rows, wires, strict=True))]


def _rows_called(model: Model, names: list[str]) -> list[int] | None:
    """Return the rows of C of these outputs; None where one of them is called otherwise."""
    places = {output.lower(): k for k, output in enumerate(model.outputs)}
    plain = [name.lower() for name in names]
    return [places[name] for name in plain] if all(name in places for name in plain) else None


def _measured_by(model: Model, names: list[str]) -> Model:
    """Keep the rows of C that the inputs carry, in the order of the inputs."""
    if not names or len(names) > len(model.outputs):
        raise DesignError(
            f"the observer has {len(names)} measurement(s) ({', '.join(names)}) of a model with {len(model.outputs)} "
            f"output(s) ({', '.join(model.outputs)}); correct [signals] or the model's outputs"
        )
    rows = _rows_called(model, names) or list(range(len(names)))
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

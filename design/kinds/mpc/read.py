"""Read and check the table of a predictive controller: model, horizon, limits, observer."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from firmloop.design.design import Request
from firmloop.design.discretize.unit_circle import poles
from firmloop.design.law import DesignError
from firmloop.design.linear.reach import ON_CIRCLE
from firmloop.design.models.model import Model, model_of, weights
from firmloop.design.models.regulator import kalman, luenberger
from firmloop.design.quadratic.condense import Constraints
from firmloop.design.table import choice, each, limits, matrix, numbers, real, truth

Array = npt.NDArray[np.float64]

LONGEST = 200  # samples of a horizon
OBSERVERS = ("none", "luenberger", "kalman")
KEYS = (
    *("horizon", "states", "A", "B", "C", "Q", "R", "P", "u_min", "u_max", "du_min", "du_max", "x_min", "x_max"),
    *("x_soft", "blocks", "reference", "delay_periods", "observer", "observer_poles", "process_noise"),
    *("measurement_noise", "offset_free", "disturbance_noise", "budget", "solver"),
    *("accuracy", "preview", "disturbances", "E"),
)


@dataclass(frozen=True, slots=True)
class MpcSetup:
    """What the table asks for, read and checked."""

    model: Model
    horizon: int
    measured: tuple[int, ...]  # indices of the inputs that carry the states, or the measurements
    seen: Array  # (r, n): what those are of the states
    reference: int | None  # index of that input
    known: tuple[int, ...]  # indices of the inputs that are known disturbances
    entry: Array  # (n, d): E, how those enter
    preview: int  # samples that reference and known disturbances are given ahead
    delay: int  # samples
    correction: Array | None  # L of the observer, the disturbances' rows last; None where the state is measured
    disturbed: bool
    limits: Constraints
    second: int | None = None  # place in the plan of the next sample's moves, which the law keeps; None: it does not

    @property
    def told(self) -> tuple[int, ...]:
        """Indices of the inputs that are not of the plant's state: the reference, then the known disturbances."""
        return (() if self.reference is None else (self.reference,)) + self.known

    @property
    def rated(self) -> bool:
        """Whether changes of u are limited."""
        return bool(np.any(np.isfinite(self.limits.du_low) | np.isfinite(self.limits.du_high)))


def setup_of(request: Request) -> MpcSetup:
    """Read and check the table of [controller]."""
    table, drives = request.table, len(request.outputs)
    if not request.outputs or not request.inputs:
        raise DesignError("controller.kind = 'mpc' needs inputs and an output in [signals]")
    model = model_of(request)
    if model is None:
        raise DesignError("controller.kind = 'mpc' needs a model: give A and B (discrete), or [plant]")
    names = [wire.name for wire in request.inputs]
    reference = _reference(table, names)
    known = _places(names, table["disturbances"], "disturbances") if "disturbances" in table else ()
    others = tuple(k for k in range(len(names)) if k != reference and k not in known)
    if "states" in table:
        others = _places(names, table["states"], "states")
    _check_apart(names, reference, known, others)
    observer = choice(table, "observer", "none", OBSERVERS)
    disturbed = truth(table, "offset_free", False)
    if len(model.a) != model.order:
        raise DesignError(
            "controller.kind = 'mpc' takes a plant without a delay of its own; set it to 0 and give "
            "controller.delay_periods, in samples"
        )
    if observer == "none" and len(others) != model.order:
        raise DesignError(
            f"mpc without an observer needs one input a state, {model.order} ({', '.join(model.names)}), but "
            f"{len(others)} are given; name them in controller.states, or give controller.observer"
        )
    seen = np.eye(model.order) if observer == "none" else model.c
    if observer != "none" and len(others) != len(seen):
        raise DesignError(
            f"mpc with an observer needs one input a measured output, {len(seen)} ({', '.join(model.outputs)}), but "
            f"{len(others)} are given; correct [signals] or C"
        )
    _check_stabilizable(model)
    low, high = limits(table, request.outputs)
    free = [np.inf] * model.order
    bounds = Constraints(
        np.array(low),
        np.array(high),
        np.array(each(table, "du_min", [-np.inf] * drives)),
        np.array(each(table, "du_max", [np.inf] * drives)),
        np.array(each(table, "x_min", [-np.inf] * model.order)),
        np.array(each(table, "x_max", free)),
        np.array(each(table, "x_soft", free)),
    )
    _check_limits(bounds, model)
    horizon, delay = whole(table, "horizon", None, 1, LONGEST), whole(table, "delay_periods", 0, 0, LONGEST)
    preview = whole(table, "preview", 0, 0, horizon + delay)
    if preview and reference is None and not known:
        raise DesignError(
            f"controller.preview = {preview} has nothing to look ahead at; name a reference or disturbances, or leave "
            "it out"
        )
    return MpcSetup(
        model,
        horizon,
        others,
        seen,
        reference,
        known,
        _entry(table, model, len(known)),
        preview,
        delay,
        _correction(request, model, seen, observer, disturbed),
        disturbed,
        bounds,
    )


def _entry(table: Mapping[str, object], model: Model, count: int) -> Array:
    """Read E, (n, count)."""
    if count:
        return matrix(table, "E", len(model.a), count, "A and controller.disturbances")
    if "E" in table:
        raise DesignError("controller.E is how known disturbances enter; name them in controller.disturbances")
    return np.zeros((len(model.a), 0))


def _check_apart(names: list[str], reference: int | None, known: tuple[int, ...], others: tuple[int, ...]) -> None:
    """Refuse an input that is named for two things."""
    named = [*(() if reference is None else (reference,)), *known, *others]
    for k in named:
        if named.count(k) > 1:
            raise DesignError(
                f"controller.states, disturbances and reference name '{names[k]}' {named.count(k)} times; an input is "
                "one of them, once"
            )


def _check_stabilizable(model: Model) -> None:
    """Refuse a mode that does not fade and that no input reaches (the test of Hautus)."""
    if not np.any(model.b):
        size = f"{len(model.a)} x {model.b.shape[1]}"
        raise DesignError(f"controller.B is all 0 ({size}): no output moves the plant; correct it")
    for shown, reached in _lasting(model.a, model.b):
        raise DesignError(
            f"controller.A has a mode at z = {shown} that does not fade and that no input reaches "
            f"(least singular value {reached:.2g}); correct A and B, or leave that state out of the model"
        )


def _check_detectable(a: Array, c: Array, disturbed: bool) -> None:
    """Refuse a mode that does not fade and that no measurement shows."""
    for shown, seen in _lasting(a.T, c.T):
        told = " (offset_free adds a disturbance at each input, z = 1)" if disturbed else ""
        raise DesignError(
            f"controller.C shows nothing of a mode at z = {shown} that does not fade{told}, so no observer can follow "
            f"it (least singular value {seen:.2g}); measure another signal, or leave that state out of the model"
        )


def _lasting(a: Array, b: Array) -> list[tuple[str, float]]:
    """Return each mode of A that does not fade and that B does not reach, and the singular value that says so."""
    found, size = [], len(a)
    for pole in poles(a):
        reached = np.linalg.svd(np.hstack([a - pole * np.eye(size), b]), compute_uv=False)[size - 1]
        if abs(pole) >= 1 - ON_CIRCLE and reached < 1e-9 * max(1.0, float(np.abs(a).max())):
            found.append((f"{pole:.6g}" if pole.imag else f"{pole.real:.6g}", float(reached)))
    return found


def _check_limits(bounds: Constraints, model: Model) -> None:
    for k, (low, high) in enumerate(zip(bounds.x_low, bounds.x_high, strict=True)):
        if not low < high:
            raise DesignError(
                f"controller.x_min = {low:g} is not below x_max = {high:g} for {model.names[k]}; no state keeps both"
            )
    for low, high in zip(bounds.du_low, bounds.du_high, strict=True):
        if not low < 0 < high:
            raise DesignError(
                f"controller.du_min = {low:g} and du_max = {high:g} do not let the output rest; "
                "du_min must be below 0 and du_max above"
            )
    if np.any(bounds.soft <= 0):
        raise DesignError(f"controller.x_soft = {bounds.soft.min():g} is out of range; it must be above 0")


def _correction(request: Request, model: Model, seen: Array, observer: str, disturbed: bool) -> Array | None:
    """Return L of the predictor, for the model's states and then the disturbances at its inputs."""
    table = request.table
    if observer == "none" and not disturbed:
        return None
    a, c, drives = model.a, seen, len(request.outputs)
    if disturbed:
        a = np.block([[a, model.b], [np.zeros((drives, len(a))), np.eye(drives)]])
        c = np.hstack([c, np.zeros((len(c), drives))])
    _check_detectable(a, c, disturbed)
    if observer == "luenberger":
        return luenberger(a, c, numbers(table, "observer_poles", None))
    size = len(model.a)
    noise = {"process_noise": 1e-6, "measurement_noise": 1e-6} if observer == "none" else {}
    process = weights({**noise, **table}, "process_noise", size, False)
    if disturbed:
        variance = real(table, "disturbance_noise", 1e-4, 0.0) * np.eye(drives)
        process = np.block([[process, np.zeros((size, drives))], [np.zeros((drives, size)), variance]])
    return kalman(a, c, process, weights({**noise, **table}, "measurement_noise", len(c), True))


def blocks_of(table: Mapping[str, object], horizon: int) -> tuple[int, ...]:
    """Read for how many samples each move is held."""
    if "blocks" not in table:
        return (1,) * horizon
    found = tuple(numbers(table, "blocks", None))
    if any(length < 1 or length != int(length) for length in found) or sum(found) != horizon:
        raise DesignError(
            f"controller.blocks = {list(found)} holds {sum(found):g} samples; give whole numbers from 1 whose sum is "
            f"the horizon, {horizon}"
        )
    return tuple(int(length) for length in found)


def whole(table: Mapping[str, object], key: str, default: int | None, low: int, high: int) -> int:
    """Read a whole number from `low` to `high`."""
    value = table.get(key, default)
    if value is None:
        raise DesignError(f"controller.{key} is missing; give a whole number from {low} to {high}")
    if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
        raise DesignError(
            f"controller.{key} = {value!r} is out of range; it must be a whole number from {low} to {high}"
        )
    return value


def _reference(table: Mapping[str, object], names: list[str]) -> int | None:
    if "reference" not in table:
        return names.index("reference") if "reference" in names else None
    return _place(names, table["reference"], "reference")


def _places(names: list[str], value: object, key: str) -> tuple[int, ...]:
    if not isinstance(value, list | tuple) or not value:
        raise DesignError(
            f'controller.{key} = {value!r} is not a list of names; write it like {key} = ["p_m", "v_m_s"]'
        )
    return tuple(_place(names, name, key) for name in value)


def _place(names: list[str], name: object, key: str) -> int:
    if name not in names:
        raise DesignError(f"controller.{key} names '{name}', which is no input; inputs: {', '.join(names)}")
    return names.index(str(name))

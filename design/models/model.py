"""The discrete model that a model-based controller rests on: from its table, or from the project's plant."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from firmloop.design.design import Request
from firmloop.design.discretize.zero_order_hold import state_space, zero_order_hold
from firmloop.design.law import DesignError
from firmloop.design.table import matrix, real
from firmloop.identify.plants.operating_point import INPUT, OUTPUT
from firmloop.identify.plants.plant import Plant
from firmloop.identify.simulation.linearize import linearize_own

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Model:
    """x[k+1] = a x[k] + b u[k], y[k] = c x[k].

    The first `order` states are the plant's own, `names` and `units` are theirs; past inputs that a delay keeps follow.
    `a_own` and `c_own` belong to the own states, with the input apart.
    """

    a: Array  # (n, n)
    b: Array  # (n, m)
    c: Array  # (r, n)
    order: int
    names: tuple[str, ...]
    units: tuple[str, ...]
    outputs: tuple[str, ...]

    @property
    def a_own(self) -> Array:
        """The plant's own part of `a`."""
        return self.a[: self.order, : self.order]

    @property
    def c_own(self) -> Array:
        """The plant's own part of `c`."""
        return self.c[:, : self.order]


def model_of(request: Request) -> Model | None:
    """Read `A`, `B` (and `C`) of the table, else sample the plant; None where there is neither."""
    table, drives = request.table, len(request.outputs)
    if "A" in table or "B" in table:
        order = len(matrix(table, "A", None, None, ""))
        a = matrix(table, "A", order, order, "its own rows")
        b = matrix(table, "B", order, drives, "A and controller.outputs")
        c = matrix(table, "C", None, order, "the columns of A") if "C" in table else np.eye(order)
        names = tuple(f"x_{k}" for k in range(1, order + 1))
        return Model(a, b, c, order, names, ("1",) * order, tuple(f"y_{k}" for k in range(1, len(c) + 1)))
    if request.plant is None:
        return None
    if len(request.plant.inputs) != drives:
        raise DesignError(
            f"the plant has {len(request.plant.inputs)} input(s) and the controller {drives} output(s); "
            "correct controller.outputs"
        )
    _check_rest(request.plant)
    own = linearize_own(request.plant)
    sampled = zero_order_hold(own.linear, request.period)
    a, b, c = state_space(sampled)
    states = [request.plant.states[k] for k in own.states]
    return Model(
        a, b, c, len(sampled.a),
        tuple(state.name for state in states), tuple(state.unit for state in states),
        tuple(output.name for output in request.plant.outputs),
    )  # fmt: skip


def _check_rest(plant: Plant) -> None:
    """Refuse a plant that rests elsewhere than at zero: the law would take a level for a deviation."""
    for parameter in plant.parameters:
        if parameter.name in (OUTPUT, INPUT) and parameter.value != 0.0:
            raise DesignError(
                f"plant.parameters.{parameter.name} is {parameter.value:g} {parameter.unit}".rstrip()
                + ", but this kind feeds back deviations from rest: take the level off the columns of the recordings "
                "and of the reference and remove the key, or choose pid, whose integral meets a level"
            )


def nominal(plant: Plant) -> Plant:
    """Return the plant without its effects."""
    return replace(plant, effects=(), parameters=plant.parameters[: plant.rate.numel_in(2)])


def weights(table: Mapping[str, object], key: str, size: int, definite: bool) -> Array:
    """Read a symmetric weight: a number for all, a list for the diagonal, or rows."""
    if key not in table:
        raise DesignError(f"controller.{key} is missing; give a number, a list of {size} numbers or a matrix")
    value = table[key]
    if isinstance(value, list | tuple) and value and all(isinstance(row, list | tuple) for row in value):
        found = matrix(table, key, size, size, "the model's sizes")
    elif isinstance(value, list | tuple):
        if len(value) != size:
            raise DesignError(f"controller.{key} has {len(value)} numbers; it needs {size}, or one number, or a matrix")
        found = np.diag([real({key: entry}, key, None) for entry in value])
    else:
        found = real(table, key, None) * np.eye(size)
    if not np.allclose(found, found.T):
        row, column = np.unravel_index(int(np.argmax(np.abs(found - found.T))), found.shape)
        raise DesignError(
            f"controller.{key} must be symmetric; row {row + 1}, column {column + 1} is {found[row, column]:g}, but "
            f"row {column + 1}, column {row + 1} is {found[column, row]:g}"
        )
    least = float(np.min(np.linalg.eigvalsh((found + found.T) / 2)))
    if least < (0 if definite else -1e-12 * np.max(np.abs(found))) or (definite and least == 0):
        rule = "symmetric and positive definite" if definite else "symmetric and not negative"
        raise DesignError(f"controller.{key} must be {rule}; its least eigenvalue is {least:g}")
    return found

"""Write the nominal equations of a plant as matrices, where they are linear."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from firmloop.identify.plants.plant import Plant

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class BalanceForm:
    """Numbers of one balance; a row holds the factors of the states, then those of the inputs."""

    per: float
    effort: Array  # (n + m,)
    current: Array  # (n + m,)
    resistance: float


@dataclass(frozen=True, slots=True)
class Forms:
    """dx/dt = a x + b u + c, y = read_x x + read_u u + read_c; zero where the equations are not linear."""

    a: Array
    b: Array
    c: Array
    read_x: Array
    read_u: Array
    read_c: Array
    balances: tuple[BalanceForm, ...]


@dataclass(frozen=True, slots=True)
class FormWriter:
    """Evaluates the matrices of one plant for any values of its nominal parameters."""

    evaluate: Callable[[], object]  # reads `given`, writes `entries`: no array is made for a call
    buffer: ca.FunctionBuffer  # lives as long as `evaluate` is called
    given: Array  # (k,) nominal parameters
    entries: Array  # all of them, one after the other
    shapes: Mapping[str, tuple[int, ...]]
    balances: int
    linear_rate: bool
    linear_reading: bool
    linear_effort: bool  # of the body that is driven

    def forms(self, constants: Array) -> Forms:
        """Return the matrices for `constants` (k,)."""
        self.given[:] = constants
        self.evaluate()
        flat = self.entries.copy()
        parts, at = {}, 0
        for name, shape in self.shapes.items():
            size = math.prod(shape)
            parts[name] = flat[at : at + size].reshape(shape)  # rows first: written so by form_writer
            at += size
        balances = tuple(
            BalanceForm(
                float(parts[f"per{k}"][0]), parts[f"effort{k}"], parts[f"current{k}"], float(parts[f"resistance{k}"][0])
            )
            for k in range(self.balances)
        )
        a, b, c, read_x, read_u, read_c = (parts[name] for name in ("a", "b", "c", "read_x", "read_u", "read_c"))
        return Forms(a, b, c, read_x, read_u, read_c, balances)


def form_writer(plant: Plant) -> FormWriter:
    """Differentiate rate, reading and balances once."""
    x, u, p = (ca.SX.sym(name, plant.rate.numel_in(k)) for k, name in enumerate("xup"))
    z = ca.vertcat(x, u)
    parts: dict[str, ca.SX] = {}
    linear = []
    for names, expression in (("abc", plant.rate(x, u, p)), (("read_x", "read_u", "read_c"), plant.reading(x, u, p))):
        slopes = ca.jacobian(expression, z)
        straight = not ca.depends_on(slopes, z)
        linear.append(straight)
        still = ca.substitute(expression, z, ca.SX.zeros(z.shape[0]))
        written = (slopes[:, : x.shape[0]], slopes[:, x.shape[0] :], still)
        for name, part in zip(names, written, strict=True):
            parts[name] = ca.densify(part) if straight else ca.SX.zeros(part.shape)
    drive = plant.balances[plant.driven].effort if plant.driven >= 0 else None
    straight_effort = drive is None or not ca.depends_on(ca.jacobian(drive(x, u, p), z), z)
    for k, balance in enumerate(plant.balances):
        parts[f"per{k}"] = balance.per(p) if balance.state >= 0 else ca.SX(0.0)
        for name, function in (("effort", balance.effort), ("current", balance.current)):
            row = ca.SX.zeros(z.shape[0]) if function is None else ca.jacobian(function(x, u, p), z).T
            row = ca.SX.zeros(z.shape[0]) if ca.depends_on(row, z) else row
            parts[f"{name}{k}"] = ca.densify(row)
        parts[f"resistance{k}"] = ca.SX(0.0) if balance.resistance is None else balance.resistance(p)
    shapes = {
        name: tuple(part.shape) if name in ("a", "b", "read_x", "read_u") else (part.shape[0],)
        for name, part in parts.items()
    }
    flat = ca.vertcat(*(ca.vec(ca.densify(part).T) for part in parts.values()))
    given, entries = np.zeros(p.numel()), np.zeros(flat.numel())
    buffer, evaluate = ca.Function("numbers", [p], [ca.densify(flat)]).buffer()
    buffer.set_arg(0, given.data)  # type: ignore[call-arg]  # a view has its own size
    buffer.set_res(0, entries.data)  # type: ignore[call-arg]
    return FormWriter(
        evaluate, buffer, given, entries, shapes, len(plant.balances), linear[0], linear[1], straight_effort
    )

"""Linearize a plant at rest."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from identify.plant import Plant
from identify.simulate import constants_of

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Linear:
    """dx/dt = a x + b u(t - delay), y = c x + d u(t - delay); continuous time, in the units of the plant's signals."""

    a: Array  # (n, n)
    b: Array  # (n, m)
    c: Array  # (r, n)
    d: Array  # (r, m)
    delay: float  # s


def linearize(plant: Plant) -> Linear:
    """Differentiate rate and reading at x = 0, u = 0 with the plant's parameter values."""
    x, u, p = (ca.SX.sym(name, plant.rate.numel_in(k)) for k, name in enumerate("xup"))
    rate, reading = plant.rate(x, u, p), plant.reading(x, u, p)
    slopes = ca.Function(
        "slopes",
        [x, u, p],
        [ca.jacobian(rate, x), ca.jacobian(rate, u), ca.jacobian(reading, x), ca.jacobian(reading, u)],
    )
    constants = constants_of(plant)
    a, b, c, d = (np.array(slope) for slope in slopes(0.0, 0.0, constants))
    names = [parameter.name for parameter in plant.parameters]
    delay = float(constants[names.index(plant.delay)]) if plant.delay is not None else 0.0
    return Linear(a, b, c, d, delay)

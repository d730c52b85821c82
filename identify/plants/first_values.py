"""Read starting values of a machine's parameters off a recording, by straight least squares on integrals of its rows.

Integrals and not derivatives: noise stays small in them, and the equations of a machine are linear in what is sought.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_LEAST = 1e-9  # a share of anything physical that a start may be put to where the rows say less than nothing


def motor_values(time: Array, voltage: Array, current: Array, speed: Array) -> Mapping[str, float]:
    """Return starting values of a brushed motor, kt = ke: u = R i + ke w in the mean, and J w = kt ∫i - b ∫w."""
    over = _integrals(time, np.column_stack([voltage, current, speed]))
    resistance, emf = _positive(over[:, 1:], over[:, 0])
    inertia, friction = _positive(np.column_stack([speed - speed[0], over[:, 2]]), emf * over[:, 1])
    step = float(np.median(np.diff(time)))
    return {
        "R_ohm": resistance,
        "L_H": resistance * step,
        "ke_V_s_rad": emf,
        "kt_N_m_A": emf,
        "J_kg_m2": inertia,
        "b_N_m_s_rad": friction,
    }


def stage_values(time: Array, drive: Array, position: Array) -> tuple[float, float]:
    """Return drive per inertia and friction per inertia of a body: w = k ∫u - c (theta - theta_0)."""
    speed = np.gradient(position, time)
    over = _integrals(time, np.column_stack([drive, speed]))
    rows = np.column_stack([over[:, 0], -over[:, 1]])
    found = np.linalg.lstsq(rows, speed - speed[0], rcond=None)[0]
    return float(found[0]) or 1.0, max(float(found[1]), _LEAST)


def _integrals(time: Array, columns: Array) -> Array:
    """Return the integral of each column up to each row, every row held until the next."""
    pieces = columns[:-1] * np.diff(time)[:, None]
    return np.vstack([np.zeros(columns.shape[1]), np.cumsum(pieces, axis=0)])


def _positive(rows: Array, wanted: Array) -> tuple[float, float]:
    """Solve for two factors that nature has above zero."""
    found = np.linalg.lstsq(rows, wanted, rcond=None)[0]
    size = float(np.max(np.abs(found))) or 1.0
    first, second = (float(one) if one > 0.0 else max(abs(float(one)), _LEAST * size) for one in found)
    return first, second

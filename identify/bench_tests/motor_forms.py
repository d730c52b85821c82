"""A DC motor's equations written out: transfer function and state space, with the inductance and without.

From L di/dt = u - R i - ke w, J dw/dt = kt i - b w (R. Krishnan, Electric Motor Drives, 2001, section 2.3)::

    second order   W(s)/U(s) = kt/(L J s^2 + (R J + L b) s + R b + ke kt)
    first order    W(s)/U(s) = kt/(R J s + R b + ke kt)                       with L = 0
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class MotorForm:
    """Voltage to speed: coefficients in falling powers of s, and dx/dt = a x + b u, speed = c x, in SI."""

    numerator: tuple[float, ...]
    denominator: tuple[float, ...]
    states: tuple[str, ...]
    a: Array
    b: Array
    c: Array


def motor_forms(parameters: Mapping[str, float]) -> Mapping[str, MotorForm]:
    """Return both forms by order; the second is left out where L is 0."""
    r, inductance, ke, kt, inertia, friction = (
        parameters[name] for name in ("R_ohm", "L_H", "ke_V_s_rad", "kt_N_m_A", "J_kg_m2", "b_N_m_s_rad")
    )
    stiff = r * friction + ke * kt
    forms = {
        "first order": MotorForm(
            (kt,),
            (r * inertia, stiff),
            ("speed_rad_s",),
            np.array([[-stiff / (r * inertia)]]),
            np.array([[kt / (r * inertia)]]),
            np.ones((1, 1)),
        )
    }
    if inductance > 0.0:
        forms["second order"] = MotorForm(
            (kt,),
            (inductance * inertia, r * inertia + inductance * friction, stiff),
            ("current_A", "speed_rad_s"),
            np.array([[-r / inductance, -ke / inductance], [kt / inertia, -friction / inertia]]),
            np.array([[1.0 / inductance], [0.0]]),
            np.array([[0.0, 1.0]]),
        )
    return forms

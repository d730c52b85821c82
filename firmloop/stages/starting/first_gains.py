"""Give a plant that rings the integral alone that its resonance allows: no tuning rule is made for one."""

from __future__ import annotations

import numpy as np

from firmloop.design.models.process import DAMPING
from firmloop.identify.simulation.linearize import Linear


def integral_of_a_ringing_plant(linear: Linear, period: float) -> float | None:
    """Return ki of an integral controller whose gain margin at the resonance is 4; None where nothing rings.

    Of k / (s^2/w^2 + 2 zeta s/w + 1) behind ki/s the loop has a gain of k ki / (2 zeta w) where its phase is -180 deg,
    which is a quarter for k ki = zeta w / 2. A delay theta is added as SIMC does: k ki = 1 / (2 / (zeta w) + 2 theta).
    """
    poles = np.linalg.eigvals(linear.a) if len(linear.a) else np.array([])
    pairs = [pole for pole in poles if 0.0 < -pole.real < DAMPING * abs(pole)]
    if not pairs or np.any(poles.real >= 0.0):
        return None
    at_rest = linear.d - linear.c @ np.linalg.solve(linear.a, linear.b)
    gain = float(at_rest[0, 0])
    slowest = 2.0 / min(float(-pole.real) for pole in pairs) + 2.0 * (linear.delay + period / 2.0)
    return 1.0 / (gain * slowest) if gain else None

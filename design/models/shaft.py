"""The shaft of a permanent-magnet machine as a loop around its current loop meets it, linear.

With T = Lq/kp_q, the current loop's time constant, and its delay of 1.5 periods::

    T di_q/dt = r_q - i_q          J dw/dt = 3/2 p psi i_q - b w          dth/dt = w

A speed loop that is closed around it, kp (b r - y) + ki int(r - y), makes r its command and adds its integral. A loop
that measures `speed_rad_s` or `angle_rad`, the signals of a current loop, sees p w and p th; any other signal in rad/s
or rad is the shaft's.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np
import numpy.typing as npt

from firmloop.identify.plants.kind import equations
from firmloop.identify.plants.plant import Parameter, Plant
from firmloop.identify.signal import Signal
from firmloop.identify.units import unit_of

Array = npt.NDArray[np.float64]

ELECTRICAL = ("speed_rad_s", "angle_rad")
LAG = 1.5  # periods of a sampled loop, from reading to the middle of what is held
ROW = {"rad/s": 1, "rad": 2}  # of the states i_q, w, th


@dataclass(frozen=True, slots=True)
class Shaft:
    """x' = a x + b r(t - delay), of the states i_q, w, th and the integrals of closed loops."""

    a: Array  # (n, n)
    b: Array  # (n,)
    delay: float  # s
    pairs: float

    def reading(self, name: str) -> Array | None:
        """Return the row that reads a signal; None for one that is no speed or angle."""
        unit = unit_of(name)
        if unit not in ROW:
            return None
        row = np.zeros(len(self.b))
        row[ROW[unit]] = self.pairs if name in ELECTRICAL else 1.0
        return row

    def plant(self, measured: str) -> Plant | None:
        """Return it as a plant whose output is the signal `measured`; None where that is no speed or angle."""
        row = self.reading(measured)
        if row is None:
            return None
        kept = [k for k in range(len(self.b)) if k != ROW["rad"] or row[k]]  # an angle that nobody sees is no state
        a, b, row = self.a[np.ix_(kept, kept)], self.b[kept], row[kept]
        x, u, p = ca.SX.sym("x", len(kept)), ca.SX.sym("u", 1), ca.SX.sym("p", 1)
        named = [f"state_{k}" for k in kept]
        return Plant(
            kind="shaft",
            states=tuple(Signal(name, "", -math.inf, math.inf) for name in named),
            inputs=(Signal("command", "", -math.inf, math.inf),),
            outputs=(Signal(measured, unit_of(measured), -math.inf, math.inf),),
            parameters=(Parameter("delay_s", "s", self.delay, False, 0.0, math.inf, None),),
            rate=equations("rate", x, u, p, ca.mtimes(ca.DM(a), x) + ca.DM(b) * u),
            reading=equations("reading", x, u, p, ca.mtimes(ca.DM(row).T, x)),
            delay="delay_s",
        )

    def closed(self, gains: Mapping[str, float], measured: str, period: float) -> Shaft | None:
        """Return it with a loop of these gains closed around it; None where that measures no speed or angle."""
        row = self.reading(measured)
        if row is None:
            return None
        kp, ki, weight = gains["kp"], gains.get("ki", 0.0), gains.get("b", 1.0)
        n = len(self.b)
        a, b = np.zeros((n + 1, n + 1)), np.zeros(n + 1)
        a[:n, :n] = self.a - np.outer(self.b, kp * row)
        a[:n, n], a[n, :n] = self.b, -ki * row
        b[:n], b[n] = kp * weight * self.b, ki
        return replace(self, a=a, b=b, delay=self.delay + period)


def shaft_of(plant: Plant, gains: Mapping[str, float], period: float) -> Shaft:
    """Return the shaft of a pmsm whose current loop has these gains and this period in s."""
    held = {parameter.name: parameter.value for parameter in plant.parameters}
    lag, inertia = held["Lq_H"] / gains["kp_q"], held["J_kg_m2"]
    a = np.array(
        [
            [-1.0 / lag, 0.0, 0.0],
            [1.5 * held["pole_pairs"] * held["flux_Wb"] / inertia, -held["b_N_m_s_rad"] / inertia, 0.0],
            [0.0, 1.0, 0.0],
        ]
    )
    return Shaft(a, np.array([1.0 / lag, 0.0, 0.0]), LAG * period, held["pole_pairs"])

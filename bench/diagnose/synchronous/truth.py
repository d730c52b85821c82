"""A permanent-magnet machine on three bridges, in the frame of its stator, written apart from the simulator it judges.

The same physics as `identify/plants/kinds/pmsm.py` and the effects say in their docstrings, in other words: the fluxes
of the stator are the states, and bridges and current sensors act phase by phase.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

SPINDLE = {  # SI
    "R_ohm": 0.36,
    "Ld_H": 0.2e-3,
    "Lq_H": 0.33e-3,
    "flux_Wb": 6.4e-3,
    "pole_pairs": 4.0,
    "J_kg_m2": 4.8e-6,
    "b_N_m_s_rad": 1.0e-5,
}
STEP, SUBSTEPS = 50e-6, 20  # s, and steps of the integration within it
_REMANENCE = 0.0011  # 1/K that the flux falls by
_SMALL = 0.02  # rad/s: as wide as the change of friction's sign
_WAYS = tuple(cmath.exp(2j * math.pi * k / 3) for k in range(3))  # of the phases


@dataclass(frozen=True, slots=True)
class Machine:
    """What is concealed, in SI; a machine with the defaults is the nominal one."""

    dead: float = 0.0  # V that each phase loses
    cogging: tuple[float, float, float] = (0.0, 1.0, 0.0)  # N m, periods a turn, rad
    ripple: tuple[float, float, float] = (0.0, 1.0, 0.0)  # of the torque, periods a turn, rad
    wave: tuple[float, float, float] = (0.0, 1.0, 0.0)  # V s/rad along q, periods a turn, rad
    offset: tuple[float, float] = (0.0, 0.0)  # A, of the sensors of phases a and b
    gain: tuple[float, float] = (1.0, 1.0)
    angle: float = 0.0  # rad, electrical: by which the axes of the drive are ahead of the magnets
    rocking: tuple[float, float] = (0.0, 0.0)  # rad, of the shaft: by which they rock about that once a turn; its phase
    heat: tuple[float, float] = (0.0, 1.0)  # K/W, s
    knee: float = math.inf  # A: at which an axis has half its inductance
    dry: float = 0.0  # N m
    drag: float = 0.0  # N m s^2
    load: tuple[float, float] = (0.0, math.inf)  # N m from s on

    def currents(self, own: complex, flux: float) -> complex:
        """Return the currents along the magnets' axes (d real) under a flux along them, A."""
        known = SPINDLE
        bare = (own.real - flux) / known["Ld_H"], own.imag / known["Lq_H"]
        d, q = bare if math.isinf(self.knee) else (self.knee * math.tan(one / self.knee) for one in bare)
        return complex(d, q)

    def ahead(self, angle: float) -> float:
        """Return by how much the axes of the drive are ahead of the magnets, rad, electrical."""
        return self.angle + SPINDLE["pole_pairs"] * self.rocking[0] * math.sin(angle + self.rocking[1])

    def taken(self, current: float) -> float:
        """Return what a phase loses, V; its sign is a steep line within the tenth of V/R that the plant tells of."""
        return self.dead * current / math.hypot(current, 0.1 * self.dead / SPINDLE["R_ohm"]) if self.dead else 0.0

    def rate(self, t: float, x: Sequence[complex], asked: complex) -> tuple[complex, ...]:
        """Return the rates of the flux, (speed, angle) and the rise; `asked` is what the drive wants along its axes."""
        known, speed, angle, rise = SPINDLE, x[1].real, x[1].imag, x[2].real
        p, turn = known["pole_pairs"], cmath.exp(1j * known["pole_pairs"] * x[1].imag)
        own = x[0] / turn
        flux = known["flux_Wb"] * (1.0 - _REMANENCE * rise)
        along = self.currents(own, flux)
        current = along * turn
        lost = sum(self.taken((current * way.conjugate()).real) * way for way in _WAYS) / 1.5
        wave = self.wave[0] * math.cos(self.wave[1] * angle + self.wave[2])
        voltage = asked * turn * cmath.exp(1j * self.ahead(angle)) - 1j * wave * speed * turn
        torque = 1.5 * p * (own.conjugate() * along).imag
        torque *= 1.0 - self.ripple[0] * math.sin(self.ripple[1] * angle + self.ripple[2])
        torque -= known["b_N_m_s_rad"] * speed + self.dry * math.tanh(speed / _SMALL) + self.drag * speed * abs(speed)
        torque += 1.5 * wave * along.imag - self.cogging[0] * math.sin(self.cogging[1] * angle + self.cogging[2])
        torque -= self.load[0] if t >= self.load[1] else 0.0
        warmed = self.heat[0] * 1.5 * known["R_ohm"] * abs(along) ** 2 - rise
        return (
            voltage - lost - known["R_ohm"] * current,
            complex(torque / known["J_kg_m2"], speed),
            complex(warmed / self.heat[1]),
        )

    def run(self, voltages: Array) -> dict[str, Array]:
        """Return the columns (n,) of a log from rest under v_d and v_q (n, 2), without noise."""
        h, x, rows = STEP / SUBSTEPS, [complex(SPINDLE["flux_Wb"]), 0j, 0j], []
        for k, (v_d, v_q) in enumerate(voltages.tolist()):
            rows.append(self.read(x))
            for j in range(SUBSTEPS):
                t = k * STEP + j * h
                k1 = self.rate(t, x, complex(v_d, v_q))
                k2 = self.rate(t + h / 2, [a + h / 2 * b for a, b in zip(x, k1, strict=True)], complex(v_d, v_q))
                k3 = self.rate(t + h / 2, [a + h / 2 * b for a, b in zip(x, k2, strict=True)], complex(v_d, v_q))
                k4 = self.rate(t + h, [a + h * b for a, b in zip(x, k3, strict=True)], complex(v_d, v_q))
                x = [a + h / 6 * (b + 2 * c + 2 * d + e) for a, b, c, d, e in zip(x, k1, k2, k3, k4, strict=True)]
        return dict(zip(COLUMNS, np.array(rows).T, strict=True))

    def read(self, x: Sequence[complex]) -> tuple[float, ...]:
        """Return what the drive reads, in the order of COLUMNS: phase c follows from the others."""
        turn = cmath.exp(1j * SPINDLE["pole_pairs"] * x[1].imag)
        current = self.currents(x[0] / turn, SPINDLE["flux_Wb"] * (1.0 - _REMANENCE * x[2].real)) * turn
        a, b = ((current * way.conjugate()).real for way in _WAYS[:2])
        a, b = self.gain[0] * a + self.offset[0], self.gain[1] * b + self.offset[1]
        seen = complex(a, (a + 2 * b) / math.sqrt(3)) / turn * cmath.exp(-1j * self.ahead(x[1].imag))
        return (seen.real, seen.imag, a, b, x[1].real, x[1].imag)


COLUMNS = ("current_d_A", "current_q_A", "current_a_A", "current_b_A", "speed_rad_s", "position_rad")

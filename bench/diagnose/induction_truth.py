"""A single-phase induction motor with what its nominal equations leave out, written apart from the simulator it judges.

The same physics as `identify/plants/kinds/single_phase_induction_motor.py` says in its docstring, in other words: the
currents come from the magnetization curve solved to the last digit, and an adaptive integrator of SciPy moves the
states.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

Array = NDArray[np.float64]

_ARC, _LATCH, _BAND, _COPPER = 1e-3, 2e-3, 1.0, 0.00393
L3510 = {  # SI: a single-phase motor of the size of a Baldor L3510
    "main_R_ohm": 0.525,
    "main_L_H": 1.4e-3,
    "aux_R_ohm": 1.17,
    "aux_L_H": 5.0e-3,
    "rotor_R_ohm": 0.68,
    "rotor_L_H": 1.4e-3,
    "magnetizing_L_H": 0.062,
    "turns_ratio": 1.8,
    "pole_pairs": 2.0,
    "capacitance_F": 340e-6,
    "switch_open_rad_s": 140.0,
    "switch_close_rad_s": 80.0,
    "J_kg_m2": 0.055,
    "b_N_m_s_rad": 1e-4,
    "load_N_m_s2_rad2": 4e-5,
    "rise_K_per_W": 0.0,
    "heating_time_s": 1000.0,
    "frequency_Hz": 60.0,
}
_LEAST = 1e-3  # rad/s: as wide as the motion in which dry friction turns round


@dataclass(frozen=True, slots=True)
class Motor:
    """Constants in SI under the names of the plant kind, and what is concealed."""

    value: dict[str, float]
    knee: float = math.inf  # A: magnetizing current at which the inductance has fallen by half
    dry: float = 0.0  # N m
    load: tuple[float, float] = (0.0, math.inf)  # N m from s on
    lost: float = 0.0  # share of the capacitance
    heat: tuple[float, float] = field(default=(0.0, 1.0))  # K/W, s

    def currents(self, x: list[float]) -> tuple[float, float, float, float]:
        """Return the currents of main winding, auxiliary winding and both rotor axes (referred to main), A."""
        v = self.value
        a, mutual = v["turns_ratio"], v["magnetizing_L_H"]
        main, aux, rotor = v["main_L_H"], v["aux_L_H"] / a**2, v["rotor_L_H"]
        push_q, push_d = x[0] / main + x[2] / rotor, x[1] / a / aux + x[3] / rotor
        leak_q, leak_d = 1 / main + 1 / rotor, 1 / aux + 1 / rotor
        more, before = 1.0, 0.0
        while abs(more - before) > 1e-13 * more:
            gap_q, gap_d = push_q / (more / mutual + leak_q), push_d / (more / mutual + leak_d)
            before, more = more, 1.0 + (gap_q**2 + gap_d**2) / (mutual * self.knee) ** 2
        return (x[0] - gap_q) / main, (x[1] / a - gap_d) / aux / a, (x[2] - gap_q) / rotor, (x[3] - gap_d) / rotor

    def rate(self, t: float, at: Array, volts: float) -> list[float]:
        """Return dx/dt: both stator fluxes, both rotor fluxes, capacitor, speed, switch, rise."""
        v, x = self.value, at.tolist()
        main, aux, q, d = self.currents(x)
        voltage = math.sqrt(2) * volts * math.sin(2 * math.pi * v["frequency_Hz"] * t)
        warm = 1 + _COPPER * x[7]
        r_main, r_aux, n = v["main_R_ohm"] * warm, v["aux_R_ohm"] * warm, v["pole_pairs"]
        opened = _ramp((x[6] - 0.25) / 0.5)
        edge = v["switch_open_rad_s"] + (v["switch_close_rad_s"] - v["switch_open_rad_s"]) * opened
        drag = v["b_N_m_s_rad"] * x[5] + v["load_N_m_s2_rad2"] * x[5] * abs(x[5])
        drag += self.dry * math.tanh(x[5] / _LEAST) + (self.load[0] if t >= self.load[1] else 0.0)
        out = [
            voltage - r_main * main,
            voltage - r_aux * aux - x[4],
            -v["rotor_R_ohm"] * q + n * x[5] * x[3],
            -v["rotor_R_ohm"] * d - n * x[5] * x[2],
            aux / (v["capacitance_F"] * (1 - self.lost)),
            (n * (x[2] * d - x[3] * q) - drag) / v["J_kg_m2"],
            (_ramp((x[5] - edge) / _BAND) - x[6]) / _LATCH,
            (self.heat[0] * (r_main * main**2 + r_aux * aux**2) - x[7]) / self.heat[1],
        ]
        if opened > 0.0:
            out[1] += opened * (self._dying(x, out, aux) - out[1])
        return out

    def _dying(self, x: list[float], rate: list[float], current: float) -> float:
        """Return the slope of the auxiliary flux under which its current dies away in the arc."""
        slopes = []
        for k in range(4):
            more, less = list(x), list(x)
            more[k] += 1e-6
            less[k] -= 1e-6
            slopes.append((self.currents(more)[1] - self.currents(less)[1]) / 2e-6)
        return (-current / _ARC - slopes[0] * rate[0] - slopes[2] * rate[2] - slopes[3] * rate[3]) / slopes[1]

    def run(self, time: Array, volts: Array) -> Array:
        """Return speed, main current and auxiliary current (n, 3) from rest; `volts` (n,) rms are held row by row."""
        x, shown = np.zeros(8), [np.zeros(3)]
        edges = [0, *(np.flatnonzero(np.diff(volts)) + 1).tolist(), len(time) - 1]
        for first, last in pairwise(edges):
            cuts = sorted(
                {time[first], time[last], *([self.load[1]] if time[first] < self.load[1] < time[last] else [])}
            )
            for begin, end in pairwise(cuts):
                asked = time[(time > begin + 1e-12) & (time < end + 1e-12)]
                found = solve_ivp(
                    self.rate, (begin, end), x, "DOP853", np.unique([*asked, end]), args=(volts[first],),
                    rtol=1e-7, atol=1e-9, max_step=2e-3,
                )  # fmt: skip
                x = found.y[:, -1]
                for state in found.y[:, : len(asked)].T:
                    main, aux, _, _ = self.currents(state.tolist())
                    shown.append(np.array([state[5], main, aux]))
        return np.array(shown)


def _ramp(share: float) -> float:
    inner = min(max(share, 0.0), 1.0)
    return inner * inner * (3.0 - 2.0 * inner)

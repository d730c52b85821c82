"""Turn a three-phase log into the rotor's frame: voltages, currents and speed, whichever way they were logged.

Voltages are logged along the axes, or as the duties of three bridges on a supply, turned by the angle that was
measured; currents along the axes, or as those of two phases, turned by the angle of the shaft.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Vectors = NDArray[np.complex128]

VOLTAGES, CURRENTS, PHASES = (
    ("voltage_d_V", "voltage_q_V"),
    ("current_d_A", "current_q_A"),
    ("current_a_A", "current_b_A"),
)
DUTIES = ("duty_a", "duty_b", "duty_c")
_BRIDGES = (*DUTIES, "supply_V", "angle_rad")


@dataclass(frozen=True, slots=True)
class RotorFrame:
    """Voltages in V and currents in A, d along the real axis, (n,); the speed of the shaft in rad/s, (n,)."""

    voltage: Vectors
    current: Vectors
    speed: Array


def rotor_frame(columns: Mapping[str, Array], pairs: float) -> RotorFrame | None:
    """Return a log as its `pairs` of poles turn it; None where it does not hold voltages, currents and speed."""
    voltage, current = voltage_of(columns), current_of(columns, pairs)
    if voltage is None or current is None or "speed_rad_s" not in columns:
        return None
    return RotorFrame(voltage, current, columns["speed_rad_s"])


def voltage_of(columns: Mapping[str, Array]) -> Vectors | None:
    """Return the voltages (n,) in V, None where they are not logged."""
    if all(name in columns for name in VOLTAGES):
        return np.asarray(columns[VOLTAGES[0]] + 1j * columns[VOLTAGES[1]])
    if any(name not in columns for name in _BRIDGES):
        return None
    a, b, c, supply, angle = (columns[name] for name in _BRIDGES)
    stator = supply * ((2.0 * a - b - c) / 3.0 + 1j * (b - c) / math.sqrt(3.0))
    return np.asarray(stator * np.exp(-1j * angle))


def current_of(columns: Mapping[str, Array], pairs: float) -> Vectors | None:
    """Return the currents (n,) in A, None where they or the angle are not logged."""
    if all(name in columns for name in CURRENTS):
        return np.asarray(columns[CURRENTS[0]] + 1j * columns[CURRENTS[1]])
    if any(name not in columns for name in (*PHASES, "position_rad")):
        return None
    a, b = (columns[name] for name in PHASES)
    return np.asarray(stator(a, b) * np.exp(-1j * pairs * columns["position_rad"]))


def stator(a: Array, b: Array) -> Vectors:
    """Return the current (n,) in A in the stator's frame, of two phases (n,)."""
    return np.asarray(a + 1j * (a + 2.0 * b) / math.sqrt(3.0))

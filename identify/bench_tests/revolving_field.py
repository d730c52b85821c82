r"""Steady state of a single-phase induction motor by the double revolving field.

A pulsating field is two that revolve against each other; at slip s the rotor meets the forward one at s, the backward
one at 2 - s (Fitzgerald, Kingsley and Umans, Electric Machinery, 6th ed., section 9.3)::

    Zf = 1/2 (j Xm || (R2/s + j X2)),     Zb = 1/2 (j Xm || (R2/(2-s) + j X2))
    V = (R1 + j X1 + Zf + Zb) Im - j a (Zf - Zb) Ia
    V = (Ra + j Xa - j Xc + a^2 (Zf + Zb)) Ia + j a (Zf - Zb) Im
    T = ((Rf - Rb) (|Im|^2 + a^2 |Ia|^2) + 2 a (Rf + Rb) |Im| |Ia| sin(angle Ia - angle Im)) / ws

with Rf, Rb the real parts of Zf, Zb (ibid., section 9.4, with the windings' own impedances). The auxiliary winding is
left out where it is switched off. Agrees with the dq equations of `kinds/single_phase_induction_motor.py` in steady
state.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class Running:
    """One operating point; currents are rms phasors against the voltage, torque is that of the air gap."""

    main: complex  # A
    aux: complex  # A; 0 where the winding is off
    torque: float  # N m
    speed: float  # rad/s
    power_in: float  # W
    power_factor: float

    @property
    def line(self) -> float:
        """Rms current of the line, A."""
        return abs(self.main + self.aux)


def field_impedances(value: Mapping[str, float], slip: float) -> tuple[complex, complex]:
    """Return Zf and Zb in ohm; `value` holds the constants of the plant kind."""
    w = 2 * math.pi * value["frequency_Hz"]
    magnetizing = 1j * w * value["magnetizing_L_H"]

    def half(part: float) -> complex:
        if part == 0:
            return 0.5 * magnetizing
        rotor = value["rotor_R_ohm"] / part + 1j * w * value["rotor_L_H"]
        return 0.5 * magnetizing * rotor / (magnetizing + rotor)

    return half(slip), half(2.0 - slip)


def running(value: Mapping[str, float], voltage: float, slip: float, starting: bool) -> Running:
    """Solve for the currents at an rms `voltage` (V); `starting`: the auxiliary winding is on."""
    w = 2 * math.pi * value["frequency_Hz"]
    forward, backward = field_impedances(value, slip)
    a = value["turns_ratio"]
    own = value["main_R_ohm"] + 1j * w * value["main_L_H"] + forward + backward
    if starting:
        aside = value["aux_R_ohm"] + 1j * (w * value["aux_L_H"] - 1.0 / (w * value["capacitance_F"]))
        across = 1j * a * (forward - backward)
        matrix: NDArray[np.complex128] = np.array([[own, -across], [across, aside + a**2 * (forward + backward)]])
        main, aux = (complex(current) for current in np.linalg.solve(matrix, np.full(2, voltage + 0j)))
    else:
        main, aux = voltage / own, 0j
    synchronous = w / value["pole_pairs"]
    even = (forward.real - backward.real) * (abs(main) ** 2 + a**2 * abs(aux) ** 2)
    odd = 2 * a * (forward.real + backward.real) * (aux * main.conjugate()).imag
    power = voltage * (main + aux).real
    apparent = voltage * abs(main + aux)
    return Running(
        main, aux, (even + odd) / synchronous, (1 - slip) * synchronous, power, power / apparent if apparent else 0.0
    )


def breakdown(value: Mapping[str, float], voltage: float) -> Running:
    """Find the point of largest torque on the main winding alone."""
    slips = np.linspace(0.005, 0.6, 600)
    best = max(slips, key=lambda s: running(value, voltage, float(s), False).torque)
    return running(value, voltage, float(best), False)


def at_load(value: Mapping[str, float], voltage: float, shaft_power: float, friction: float) -> Running:
    """Find the running point below breakdown whose shaft gives `shaft_power` (W); `friction` (W) is lost on the way.

    Raises
    ------
    ValueError
        where the motor cannot give it.
    """
    top = breakdown(value, voltage)
    most = 1.0 - top.speed * value["pole_pairs"] / (2 * math.pi * value["frequency_Hz"])
    low, high = 0.0, most
    if top.torque * top.speed - friction < shaft_power:
        raise ValueError(f"{shaft_power:g} W is more than this motor gives at {voltage:g} V; ask for less")
    for _ in range(80):
        slip = 0.5 * (low + high)
        point = running(value, voltage, slip, False)
        low, high = (slip, high) if point.torque * point.speed - friction < shaft_power else (low, slip)
    return running(value, voltage, 0.5 * (low + high), False)

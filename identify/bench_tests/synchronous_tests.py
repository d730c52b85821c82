"""The standard bench tests of a permanent-magnet machine: each gives parameters, with their standard deviations.

Formulas: IEEE Std 1812-2014, Guide for Testing Permanent Magnet Machines, sections 4 (resistance), 5 (open circuit), 6
(inductance) and 8 (retardation); dead time as in J. Holtz and J. Quan, IEEE Trans. Ind. Appl. 38(4), 2002.
R and L are of one phase of the star that acts like the machine, whatever its winding is.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from firmloop.identify.bench_tests.standard_tests import Measured, averaged, locked_rotor_dc
from firmloop.identify.error import IdentifyError
from firmloop.identify.fitting.least_squares import fit_function

Array = NDArray[np.float64]
Known = Mapping[str, Measured]

EVALUATIONS = 100  # of a curve of a few unknowns, which takes ten
FEWEST = 20  # rows
ALONG = 4.0 / 3.0  # of the voltage that a dead time takes from each phase, along an axis that lies on one


def phase_to_phase(voltage: Sequence[float], current: Sequence[float]) -> Known:
    """R from a direct current through two phases in series: U = U0 + 2 R I, half of U0 lost in each bridge."""
    twice = locked_rotor_dc(voltage, current)["R_ohm"]
    half = None if twice.deviation is None else twice.deviation / 2.0
    found = {"R_ohm": Measured(twice.value / 2.0, half)}
    if max(current) - min(current) < 0.2 * max(current):
        return found
    lost = float(np.mean(np.array(voltage) - twice.value * np.array(current))) / 2.0
    spread = None if half is None else half * float(np.mean(current))
    return found | {"dead_time.voltage_V": Measured(max(lost, 0.0), spread)}


def locked_axis(time: Array, voltage: Array, current: Array, axis: str) -> Known:
    """R, L and dead time from the voltage along one axis with the rotor held: steps or a sine, of two sizes.

    L di/dt = v - R i - 4/3 V sign(i), the voltage held from row to row. R alone cannot tell V: two sizes do, for what
    a dead time takes does not grow with the current.
    """
    name = f"standard_tests.locked_{axis}"
    if len(time) < FEWEST or not np.any(voltage):
        raise IdentifyError(f"{name} has {len(time)} rows; record steps of voltage_{axis}_V over {FEWEST} rows or more")
    largest = float(np.max(np.abs(current)))
    steps = np.diff(time)

    def missed(unknowns: Array) -> Array:
        resistance, inductance, lost, begun = unknowns.tolist()
        return _slowed(steps, voltage[:-1], begun, (inductance, resistance, ALONG * lost)) - current

    guess = max(float(np.max(np.abs(voltage))) / largest, 1e-9)
    typical = np.array([guess, guess * 10.0 * float(np.median(steps)), 0.1 * float(np.max(np.abs(voltage))), largest])
    start = np.array([guess, typical[1], 0.0, float(current[0])])
    low = np.array([1e-9 * guess, 1e-9 * typical[1], 0.0, -np.inf])
    found, covariance = fit_function(missed, start, typical, low, EVALUATIONS)
    deviations = np.sqrt(np.diag(covariance))
    if not np.all(np.isfinite(deviations[:2])):
        raise IdentifyError(f"{name} does not tell R and L apart; record steps that the current has not settled after")
    made = [Measured(float(value), float(wide)) for value, wide in zip(found, deviations, strict=True)]
    two = np.isfinite(deviations[2]) and deviations[2] < 0.5 * float(np.max(np.abs(voltage)))
    return {"R_ohm": made[0], f"L{axis}_H": made[1]} | ({"dead_time.voltage_V": made[2]} if two else {})


def _slowed(steps: Array, drive: Array, begun: float, loss: tuple[float, float, float]) -> Array:
    """Return y (n,) of m dy/dt = drive - a y - c sign(y) from `begun`, the drive held for each step; loss is (m, a, c).

    Where y passes 0 within a step, the moment is found, for the drive then moves it at another pace; what the drive
    does not overcome stays at 0.
    """
    mass, slope, dry = loss
    lag, y, made = mass / slope, begun, [begun]
    for step, force in zip(steps.tolist(), drive.tolist(), strict=True):
        sign = math.copysign(1.0, y or force)
        rest = (force - sign * dry) / slope
        end = rest + (y - rest) * math.exp(-step / lag) if y or rest * sign > 0.0 else 0.0
        if end * sign < 0.0:
            passed = lag * math.log1p(-y / rest)
            back = (force + sign * dry) / slope
            end = -back * math.expm1((passed - step) / lag) if back * sign < 0.0 else 0.0
        y = end
        made.append(y)
    return np.array(made)


def spinning(voltage: Sequence[float], speed: Sequence[float], pairs: float) -> Known:
    """Find psi with open terminals, another motor turning it: two phases show an rms voltage of sqrt(3/2) p psi w."""
    readings = [math.sqrt(2.0 / 3.0) * volts / (pairs * turning) for volts, turning in zip(voltage, speed, strict=True)]
    return {"flux_Wb": averaged(readings)}


def alignment(position: Sequence[float], pairs: float) -> Known:
    """Find what the encoder shows, electrical, where a current along phase a has pulled d onto it: a circular mean."""
    turns = np.exp(1j * pairs * np.array(position))
    middle = complex(np.mean(turns))
    if abs(middle) < 0.5:
        raise IdentifyError(
            f"standard_tests.alignment: readings are spread over {math.degrees(np.sqrt(-2 * np.log(abs(middle)))):.0f} "
            "degrees (electrical); let the rotor come to rest on phase a before each one"
        )
    spread = averaged(np.angle(turns / middle).tolist()).deviation
    return {"angle_offset.offset_rad": Measured(float(np.angle(middle)), spread)}


def run_up(time: Array, current: Array, speed: Array, per_ampere: float) -> Known:
    """J, b and dry friction from running up and coasting down: J dw/dt = 3/2 p psi iq - b w - Tc sign(w).

    `per_ampere` is 3/2 p psi in N m/A. The speed is simulated from the recorded current.
    """
    steps, top = np.diff(time), float(np.max(np.abs(speed)))
    torque = per_ampere * current
    if len(time) < FEWEST or np.ptp(torque) == 0.0:
        raise IdentifyError(
            f"standard_tests.run_up: current_q_A does not change over {len(time)} rows; record a run-up and the "
            "coast-down after it"
        )

    def missed(unknowns: Array) -> Array:
        inertia, damping, dry, begun = unknowns.tolist()
        return _slowed(steps, torque[:-1], begun, (inertia, damping, dry)) - speed

    share = float(np.sum(np.abs(torque[:-1]) * steps)) / top
    typical = np.array([share, 0.1 * share / float(time[-1] - time[0]), 0.1 * float(np.max(np.abs(torque))), top])
    low = np.array([1e-6 * share, 1e-6 * typical[1], 0.0, -np.inf])
    start = np.array([share, typical[1], 0.0, float(speed[0])])
    found, covariance = fit_function(missed, start, typical, low, EVALUATIONS)
    wide = np.sqrt(np.diag(covariance))
    names = ("J_kg_m2", "b_N_m_s_rad", "coulomb_N_m")
    return {
        name: Measured(float(value), float(deviation) if math.isfinite(deviation) else None)
        for name, value, deviation in zip(names, found, wide, strict=False)
    }

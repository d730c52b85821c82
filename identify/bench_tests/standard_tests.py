"""The standard bench tests of a brushed DC motor: each gives parameters, with their standard deviations.

Formulas: R. Krishnan, Electric Motor Drives (2001), section 2.2 (equations of the motor) and IEEE Std 113-1985, Guide:
Test Procedures for Direct-Current Machines, sections 5 to 7 (resistance, inductance, inertia by retardation).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from firmloop.identify.error import IdentifyError
from firmloop.identify.fitting.least_squares import fit_function
from firmloop.identify.normal import NORMAL_95

Array = NDArray[np.float64]

EVALUATIONS = 100  # of a curve of two unknowns, which takes ten
APART = 0.2  # of the largest reading: readings closer together are repeats of one point and tell no slope


@dataclass(frozen=True, slots=True)
class Measured:
    """One parameter as a test gave it, with its standard deviation, None where the readings cannot tell it.

    Of few readings it is widened by Student's t: 1.96 of it to each side are a 95 % interval.
    """

    value: float
    deviation: float | None


def locked_rotor_dc(voltage: Sequence[float], current: Sequence[float]) -> Mapping[str, Measured]:
    """R from volts over amperes at standstill: U = U_b + R I, the brushes' drop U_b taken by the line's offset.

    One reading, or repeats of one: R = U/I.
    """
    if _repeats(current):
        return {"R_ohm": averaged([volts / amperes for volts, amperes in zip(voltage, current, strict=True)])}
    slope, _, deviation, _ = _line("locked_rotor_dc", current, voltage)
    return {"R_ohm": _above_zero("locked_rotor_dc", "resistance", slope, deviation)}


def locked_rotor_ac(
    voltage: Sequence[float],
    current: Sequence[float],
    frequency: Sequence[float],
    resistance: float,
    doubt: float = 0.0,
) -> Mapping[str, Measured]:
    """L from the impedance at standstill (rms values): (U/I)^2 = R^2 + (2 pi f L)^2, averaged over the readings.

    `doubt` is the deviation of the resistance, ohm; it moves all readings the same way.
    """
    found, slopes = [], []
    for volts, amperes, hertz in zip(voltage, current, frequency, strict=True):
        impedance = volts / amperes
        if impedance <= resistance:
            raise IdentifyError(
                f"standard_tests.locked_rotor_ac: {volts:g} V and {amperes:g} A at {hertz:g} Hz make {impedance:.3g} "
                f"ohm, not above the resistance of {resistance:.3g} ohm; use a higher frequency, or measure it again"
            )
        reactance = math.sqrt(impedance**2 - resistance**2)
        found.append(reactance / (2 * math.pi * hertz))
        slopes.append(resistance / reactance / (2 * math.pi * hertz))
    return {"L_H": _doubted(averaged(found), float(np.mean(slopes)) * doubt)}


def no_load(
    voltage: Sequence[float], current: Sequence[float], speed: Sequence[float], resistance: float, doubt: float = 0.0
) -> Mapping[str, Measured]:
    """Ke and friction from steady running without load: U - R I = ke w, and kt I = Tc + b w with kt = ke.

    One speed leaves friction all viscous: b = ke I/w. From two speeds on the Coulomb part Tc is told apart; a part that
    comes out below 0 is 0, and the other is found anew. `doubt` is the deviation of the resistance, ohm.
    """
    u, i, w = (np.array(values, dtype=np.float64) for values in (voltage, current, speed))
    emf = u - resistance * i
    ke = float(emf @ w / (w @ w))
    if ke <= 0.0:
        raise IdentifyError(
            f"standard_tests.no_load: R I = {resistance * i[0]:.3g} V is more than the {u[0]:g} V applied; check the "
            "resistance, and the signs of voltage and speed"
        )
    own = averaged((emf / w).tolist())
    constant = _doubted(Measured(ke, own.deviation), float(i @ w / (w @ w)) * doubt)
    found = {"ke_V_s_rad": constant, "kt_N_m_A": constant}
    torque = ke * np.abs(i)
    if _repeats(np.abs(w).tolist()):
        friction = {"b_N_m_s_rad": averaged((torque / np.abs(w)).tolist())}
    else:
        slope, offset, deviation, offset_deviation = _line("no_load", np.abs(w).tolist(), torque.tolist())
        friction = {"b_N_m_s_rad": Measured(slope, deviation), "coulomb_N_m": Measured(offset, offset_deviation)}
        if offset < 0.0:
            friction = {"b_N_m_s_rad": averaged((torque / np.abs(w)).tolist()), "coulomb_N_m": Measured(0.0, None)}
        elif slope < 0.0:
            friction = {"b_N_m_s_rad": Measured(0.0, None), "coulomb_N_m": averaged(torque.tolist())}
    share = (constant.deviation or 0.0) / ke
    return found | {name: _doubted(one, one.value * share) for name, one in friction.items()}


def coast_down(
    time: Array, speed: Array, damping: float, coulomb: float, doubt: tuple[float, float] = (0.0, 0.0)
) -> Mapping[str, Measured]:
    """J from free running to a stop, time (n,) in s and speed (n,) in rad/s: J dw/dt = -b w - Tc.

    w = (w0 + Tc/b) exp(-t b/J) - Tc/b is fitted for J and w0; b = 0 makes it a straight line. The retardation test of
    IEEE Std 113. `doubt` are the deviations of damping and Coulomb friction, whose torque J is proportional to.
    """
    sign = math.copysign(1.0, float(speed[0]))
    moving = sign * speed > 0.05 * abs(float(speed[0]))
    t, w = (time - time[0])[moving], sign * speed[moving]
    if len(t) < 5 or w[-1] > 0.8 * w[0]:
        raise IdentifyError(
            "standard_tests.coast_down: the speed does not fall to 80 % of its start over 5 rows; record from "
            "switching off until it stands still"
        )
    if damping <= 0.0 and coulomb <= 0.0:
        raise IdentifyError(
            "standard_tests.coast_down: without friction nothing stops the rotor; give [standard_tests.no_load] too"
        )

    def missed(unknowns: Array) -> Array:
        inertia, first = unknowns
        if damping * t[-1] < 1e-9 * inertia:
            return np.asarray(first - coulomb / inertia * t - w)
        limit = coulomb / damping
        return np.asarray((first + limit) * np.exp(-t * damping / inertia) - limit - w)

    guess = (damping * float(w.mean()) + coulomb) * float(t[-1]) / float(w[0] - w[-1])
    start = np.array([guess, float(w[0])])
    found, covariance = fit_function(missed, start, start, np.array([1e-30, 0.0]), EVALUATIONS)
    inertia, middle = float(found[0]), float(w.mean())
    unsure = math.hypot(doubt[0] * middle, doubt[1]) / (damping * middle + coulomb)
    return {"J_kg_m2": _doubted(Measured(inertia, float(math.sqrt(covariance[0, 0]))), inertia * unsure)}


def step_test(time_constant: float, parameters: Mapping[str, float]) -> Mapping[str, Measured]:
    """J from the speed's time constant T after a step of the voltage, s: J = T (ke kt/R + b)."""
    stiffness = parameters["ke_V_s_rad"] * parameters["kt_N_m_A"] / parameters["R_ohm"] + parameters["b_N_m_s_rad"]
    return {"J_kg_m2": Measured(time_constant * stiffness, None)}


def _above_zero(test: str, what: str, value: float, deviation: float | None) -> Measured:
    if value <= 0.0:
        raise IdentifyError(f"standard_tests.{test}: the {what} comes out as {value:.3g}; check the readings' signs")
    return Measured(value, deviation)


def _repeats(values: Sequence[float]) -> bool:
    """Tell whether readings are one, or several of one point."""
    return max(values) - min(values) < APART * max(abs(value) for value in values)


def averaged(values: Sequence[float]) -> Measured:
    """Mean of readings, with the deviation of the mean; a single one has none."""
    count = len(values)
    if count == 1:
        return Measured(values[0], None)
    return Measured(float(np.mean(values)), _widened(float(np.std(values, ddof=1)) / math.sqrt(count), count - 1))


def _widened(deviation: float, freedom: int) -> float:
    return deviation * float(scipy.special.stdtrit(freedom, 0.975)) / NORMAL_95


def _doubted(one: Measured, more: float) -> Measured:
    """Add an independent deviation; where the readings tell none, it is all that is known."""
    return one if more == 0.0 else Measured(one.value, math.hypot(one.deviation or 0.0, more))


def _line(test: str, x: Sequence[float], y: Sequence[float]) -> tuple[float, float, float | None, float | None]:
    """Slope and offset of a straight line, and their standard deviations from three readings on."""
    if len(x) != len(y):
        raise IdentifyError(f"standard_tests.{test} has {len(x)} and {len(y)} readings; give as many of each")
    if len(x) == 2:
        slope = (y[1] - y[0]) / (x[1] - x[0])
        return slope, y[0] - slope * x[0], None, None
    found, covariance = np.polyfit(np.array(x), np.array(y), 1, cov="unscaled")
    spread = float(np.sum((np.polyval(found, x) - np.array(y)) ** 2)) / (len(x) - 2)
    return (
        float(found[0]),
        float(found[1]),
        _widened(math.sqrt(spread * covariance[0, 0]), len(x) - 2),
        _widened(math.sqrt(spread * covariance[1, 1]), len(x) - 2),
    )

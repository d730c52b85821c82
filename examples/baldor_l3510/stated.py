"""What the study of the Baldor L3510 states: datasheet, table 1 and the two models, as printed."""

from __future__ import annotations

import math

import numpy as np

from firmloop.identify.bench_tests.induction_tests import HORSEPOWER, POUND_FOOT, POUND_FOOT_SQUARED

VOLTS, HERTZ, POLES = 115.0, 60.0, 4
OMEGA = 2 * math.pi * HERTZ
SYNCHRONOUS = OMEGA / (POLES / 2)  # rad/s
RATED_RPM, RATED_AMPS, START_AMPS, NO_LOAD_AMPS = 1750.0, 12.5, 85.3, 9.53
START_PF, NO_LOAD_PF = 0.948, 0.2  # the second is assumed by the study
R_MAIN, R_AUX, C_START = 0.525, 1.17, 340e-6
RATED_TORQUE, LOCKED_TORQUE, BREAKDOWN_TORQUE = (pounds * POUND_FOOT for pounds in (3.01, 13.9, 9.7))
ROTOR_INERTIA = 0.203 * POUND_FOOT_SQUARED
POWER = HORSEPOWER  # rated output, W

# Load characteristics at 115 V: share of rated load, power factor %, efficiency %, rpm, line amperes.
LOAD = np.array(
    [
        (0.25, 33, 53.5, 1786, 9.3),
        (0.50, 48, 67.3, 1775, 9.98),
        (0.75, 60, 72.9, 1763, 11.06),
        (1.00, 69, 74.9, 1750, 12.51),
        (1.25, 76, 74.6, 1735, 14.28),
        (1.50, 80, 72.8, 1714, 16.82),
    ]
)
SERVICE = {"power factor": 80.0, "efficiency": 67.2, "speed": 1704.0, "line amperes": 13.9}

K1, TAU = 0.79, 0.20  # G1
RESULTS_G1 = 0.20, 10.79  # numerator and pole of G1 where the results print it
ZETA, NATURAL = 0.8, 6.0
NUMERATOR, MIDDLE, LAST = 28.4, 9.6, 36.0  # of G2 = NUMERATOR/(s^2 + MIDDLE s + LAST)
STEADY_SPEED, SETTLED, SIMULATED = 183.3, 0.85, 0.82  # rad/s, s: "measured"; s, of G1
RMSE = {"first order": 4.32, "second order": 2.28, "prior work": 9.75}  # rad/s, table 2
SETTLING_ERROR = {"first order": 3.5, "second order": 1.8, "prior work": 12.7}  # %, table 2
GAIN_ERROR = {"first order": 1.9, "second order": 0.7, "prior work": 5.3}  # %, table 2
DRIFT = 0.00393  # 1/K, copper's resistance with temperature

# Table 1: what it computes, and with what.
L_AUX, K_E, K_T, J_USED, B, TAU_M, TORQUE = 1.25e-3, 0.61, 0.326, 0.00855, 0.0216, 0.396, 4.08

# What table 1 takes from figure 1 unchanged: as both print it.
TAKEN = {
    "input voltage": "115/230 V",
    "frequency": "60 Hz",
    "rotor speed": "1750 rpm",
    "starting current": "85.3 A",
    "no-load current": "9.53 A",
    "main winding resistance": "0.525 ohm",
    "temperature rise at rated load": "62 degC",
}
UNSEEN = {  # and what it says to be on a page of the datasheet that the study does not show
    "auxiliary winding resistance": "1.17 ohm",
    "start capacitor": "340 +- 10 uF",
    "insulation class": "F, 155 degC",
}

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
ZETA, NATURAL, NUMERATOR = 0.8, 6.0, 28.4  # G2
STEADY_SPEED, SETTLED = 183.3, 0.85  # rad/s, s: "measured"

# What table 1 takes from figure 1 unchanged: as table 1 prints it, as figure 1 prints it.
TAKEN = {
    "input voltage": ("115/230 V", "115/230 V"),
    "frequency": ("60 Hz", "60 Hz"),
    "starting current": ("85.3 A", "85.3 A"),
    "rated current": ("12.5/6.3 A", "12.5/6.3 A"),
    "no-load current": ("9.53 A", "9.53 A"),
    "main winding resistance": ("0.525 ohm", "0.525 ohm"),
    "rotor speed": ("1750 rpm", "1750 rpm"),
    "temperature rise at rated load": ("62 degC", "62 degC"),
    "efficiency": ("74 %", "74 %"),
    "power factor": ("69 %", "69 %"),
}
UNSEEN = {  # and what it says to be on a page of the datasheet that the study does not show
    "auxiliary winding resistance": "1.17 ohm",
    "start capacitor": "340 +- 10 uF",
    "insulation class": "F, 155 degC",
}

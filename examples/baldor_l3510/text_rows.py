"""Rows of the audit for what the L3510 study says beside its tables: formulas, block diagrams, claims, instruments."""

from __future__ import annotations

import math

import numpy as np

from examples.audit_table import Row, missing
from examples.baldor_l3510.stated import K1, NATURAL, NUMERATOR, SETTLED, STEADY_SPEED, TAU, VOLTS
from firmloop.identify.fitting.scores import scores

PRINTED = 0.20, 10.79  # numerator and pole of G1 where the results print it


def rows() -> list[Row]:
    """Return them in the order of the study."""
    left = np.array([3.0, -4.0])
    rmse = scores(left, np.zeros(2)).rmse
    settling, gain = 100 * abs(0.82 - SETTLED) / SETTLED, 100 * abs(K1 * VOLTS / STEADY_SPEED - 1)
    encoder = math.radians(0.1) / 1e-3
    return [
        Row("eq. 5", "RMSE", "sqrt(mean of squares)", f"{rmse:.4g} for 3 and -4", True, "identify: rmse of an output"),
        Row("eq. 6", "settling time error", "of model and measured", f"{settling:.2f} %", True, "0.82 and 0.85 s"),
        missing(
            "eq. 7",
            "steady-state gain error of G1",
            "< 2 %",
            f"by the study's own formula, with its 0.79 and its {STEADY_SPEED} rad/s from {VOLTS:.0f} V",
            f"{gain:.0f} %",
        ),
        missing(
            "contributions",
            "settling time errors",
            "below 3.5 %",
            "its own figures give slightly more",
            f"{settling:.2f} %",
        ),
        missing(
            "contributions",
            "tau and zeta follow from rotor inertia and back-EMF constant",
            "stated",
            "no formula is given, an induction motor has no back-EMF constant, and table 1's J/B is not tau",
        ),
        missing(
            "fig. 2",
            "block diagram of the first order",
            "step of 115 V",
            f"G1 = {K1}/({TAU:.2f} s + 1) ends at the first figure, G1 as the results print it at the second, the "
            f"motor at {STEADY_SPEED}",
            f"{K1 * VOLTS:.1f} and {PRINTED[0] / PRINTED[1] * VOLTS:.1f} rad/s",
        ),
        missing(
            "fig. 4",
            "block diagram of the second order",
            "step of 115 V",
            f"G2 ends there, the motor at {STEADY_SPEED}; its caption speaks of a first phase",
            f"{NUMERATOR / NATURAL**2 * VOLTS:.1f} rad/s",
        ),
        missing(
            "experiment",
            "encoder beside 1 kHz",
            "+- 0.1 deg",
            "so much speed may differences of neighboring samples be off to each side, and how speed was formed is not "
            "said; the RMSE of 2.28 rad/s is smaller",
            f"{2 * encoder:.1f} rad/s",
        ),
        missing(
            "discussion",
            "hardware that each method needs",
            "Cortex-M4, DSP, FPGA, PC",
            "nothing is counted; the sliding mode that is to need an FPGA runs on the same Cortex-M4F (the row on its "
            "complexity)",
        ),
        missing("discussion", "tau = 0.20 s governs after 0.5 s", "t > 0.5 s", "after 2.5 tau 92 % of G1's way is made",
                f"{100 * (1 - math.exp(-0.5 / TAU)):.0f} %"),
    ]  # fmt: skip

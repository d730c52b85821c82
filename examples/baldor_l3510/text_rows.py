"""Rows of the audit for what the L3510 study says beside its tables: formulas, block diagrams, claims, instruments."""

from __future__ import annotations

import math

import numpy as np

from examples.audit_table import Row, judged, stated
from examples.baldor_l3510.stated import (
    K1,
    LAST,
    NUMERATOR,
    RESULTS_G1,
    RMSE,
    SETTLED,
    SETTLING_ERROR,
    SIMULATED,
    STEADY_SPEED,
    TAU,
    VOLTS,
)
from firmloop.identify.fitting.scores import scores

ENCODER, PERIOD = math.radians(0.1), 1e-3  # rad to each side, s


def rows() -> list[Row]:
    """Return them in the order of the study."""
    settling, gain = 100 * abs(SIMULATED - SETTLED) / SETTLED, 100 * abs(K1 * VOLTS / STEADY_SPEED - 1)
    numerator, pole = RESULTS_G1
    return [
        judged("eq. 5", "RMSE", "sqrt(mean of squares)", _rmse, "identify's rmse of an output against the formula"),
        judged(
            "eq. 6",
            "settling time error",
            f"{SETTLING_ERROR['first order']} %",
            lambda: (f"{settling:.2f} %", round(settling, 1) == SETTLING_ERROR["first order"]),
            "of model and measured, 0.82 and 0.85 s",
        ),
        judged(
            "eq. 7",
            "steady-state gain error of G1",
            "< 2 %",
            lambda: (f"{gain:.0f} %", gain < 2),
            f"by the study's own formula, with its 0.79 and its {STEADY_SPEED} rad/s from {VOLTS:.0f} V",
        ),
        judged(
            "contributions",
            "settling time errors",
            "below 3.5 %",
            lambda: (f"{settling:.2f} %", settling < 3.5),
            "its own figures give slightly more",
        ),
        stated(
            "contributions",
            "tau and zeta follow from rotor inertia and back-EMF constant",
            "stated",
            "no formula is given, an induction motor has no back-EMF constant, and table 1's J/B is not tau",
        ),
        judged(
            "fig. 2",
            "block diagram of the first order",
            "step of 115 V",
            lambda: (
                f"{K1 * VOLTS:.1f} and {numerator / pole * VOLTS:.1f} rad/s",
                max(abs(end / STEADY_SPEED - 1) for end in (K1 * VOLTS, numerator / pole * VOLTS)) < 0.02,
            ),
            f"G1 = {K1}/({TAU:.2f} s + 1) ends at the first figure, G1 as the results print it at the second, the "
            f"motor at {STEADY_SPEED}",
        ),
        judged(
            "fig. 4",
            "block diagram of the second order",
            "step of 115 V",
            lambda: (
                f"{NUMERATOR / LAST * VOLTS:.1f} rad/s",
                abs(NUMERATOR / LAST * VOLTS / STEADY_SPEED - 1) < 0.02,
            ),
            f"G2 ends there, the motor at {STEADY_SPEED}; its caption speaks of a first phase",
        ),
        judged(
            "experiment",
            "encoder beside 1 kHz",
            "+- 0.1 deg",
            lambda: (f"{2 * ENCODER / PERIOD:.1f} rad/s", 2 * ENCODER / PERIOD < RMSE["second order"]),
            "so much speed may differences of neighboring samples be off to each side, and how speed was formed is not "
            "said; it would have to be below the RMSE of 2.28 rad/s",
        ),
        stated(
            "discussion",
            "hardware that each method needs",
            "Cortex-M4, DSP, FPGA, PC",
            "nothing is counted; the sliding mode that is to need an FPGA runs on the same Cortex-M4F (the row on its "
            "complexity)",
        ),
        judged(
            "discussion",
            "tau = 0.20 s governs after 0.5 s",
            "t > 0.5 s",
            lambda: (f"{100 * (1 - math.exp(-0.5 / TAU)):.0f} %", math.exp(-0.5 / TAU) > 0.5),
            "so much of G1's way is made by then; to govern, it would have to have most before it",
        ),
    ]


def _rmse() -> tuple[str, bool]:
    left = np.array([3.0, -4.0])
    found, formula = scores(left, np.zeros(2)).rmse, math.sqrt(float(np.mean(left**2)))
    return f"{found:.4g} for 3 and -4", math.isclose(found, formula)

"""Rows of the audit for what the RE 15 study says beside its table: repeats, residuals, tuning, tests."""

from __future__ import annotations

from examples.audit_table import Row, missing


def rows() -> list[Row]:
    """Return them in the order of the study."""
    none = "no parameter and no measured curve is printed"
    return [
        missing("data set", "resistance, inductance, constants, inertia", "from the datasheet", none),
        missing("data set", "damping and inertia estimated, then refined", "named", none),
        missing("experiment", "no-load, locked-rotor and step tests", "named", "no reading of any of them is printed"),
        missing("experiment", "each test three times, averaged", "n = 3", "neither means nor deviations are printed"),
        missing("processing", "average error margin", "< 5 %", "table 1 has no measured column to hold it against"),
        missing(
            "processing", "integral of squared error minimized", "ISE", "no value is printed, nor the gains it led to"
        ),
        missing("processing", "gain scheduling over input voltages", "considered", "no gain and no voltage is printed"),
        missing("statistics", "residuals scatter around zero", "no structural error", "no residual is printed"),
        missing("statistics", "absolute and percentage errors of each figure", "< 5 %", "none is printed"),
        missing(
            "discussion",
            "first and second order alike in closed loop",
            "similar",
            "table 1: overshoot 7 % and 2.9 %, steady-state error 0.7 % and 0.3 %",
            "2.4 and 2.3 times",
        ),
        missing(
            "conclusion",
            "closed loop of order 2 the best in all",
            "best results",
            "table 1: the closed loop of order 1 rises faster",
            "0.16 s against 0.18 s",
        ),
        missing("discussion", "heat, noise, backlash and load neglected", "named", "no size of any is given"),
    ]

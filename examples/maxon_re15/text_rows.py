"""Rows of the audit for what the RE 15 study says beside its table: repeats, residuals, tuning, tests."""

from __future__ import annotations

from examples.audit_table import Row, judged, stated
from examples.maxon_re15.published import TABLE

NONE = "no parameter and no measured curve is printed"


def rows() -> list[Row]:
    """Return them in the order of the study."""
    return [
        stated("data set", "resistance, inductance, constants, inertia", "from the datasheet", NONE),
        stated("data set", "damping and inertia estimated, then refined", "named", NONE),
        stated("experiment", "no-load, locked-rotor and step tests", "named", "no reading of any of them is printed"),
        stated("experiment", "each test three times, averaged", "n = 3", "neither means nor deviations are printed"),
        stated("processing", "average error margin", "< 5 %", "table 1 has no measured column to hold it against"),
        stated(
            "processing", "integral of squared error minimized", "ISE", "no value is printed, nor the gains it led to"
        ),
        stated("processing", "gain scheduling over input voltages", "considered", "no gain and no voltage is printed"),
        stated("statistics", "residuals scatter around zero", "no structural error", "no residual is printed"),
        stated("statistics", "absolute and percentage errors of each figure", "< 5 %", "none is printed"),
        judged(
            "discussion",
            "first and second order alike in closed loop",
            "similar",
            _alike,
            "table 1: overshoot and steady-state error of order 1 over those of order 2; alike would be within a half",
        ),
        judged(
            "conclusion",
            "closed loop of order 2 the best in all",
            "best results",
            _best,
            "table 1: the figures in which another row is lower",
        ),
        stated("discussion", "heat, noise, backlash and load neglected", "named", "no size of any is given"),
    ]


def _alike() -> tuple[str, bool]:
    one, two = TABLE["closed loop, order 1"], TABLE["closed loop, order 2"]
    over, error = float(one.overshoot) / float(two.overshoot), float(one.error) / float(two.error)
    return f"{over:.1f} and {error:.1f} times", max(over, error) < 1.5


def _best() -> tuple[str, bool]:
    best = TABLE["closed loop, order 2"]
    beaten = [
        f"{name}: {getattr(row, name)} against {getattr(best, name)}"
        for name in ("rise", "overshoot", "settling", "error")
        for row in TABLE.values()
        if float(getattr(row, name)) < float(getattr(best, name))
    ]
    return "; ".join(beaten) or "none", not beaten

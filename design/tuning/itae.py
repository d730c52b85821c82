"""ITAE: the least integral of the absolute error times the time since the step (`pid_search.py`)."""

from __future__ import annotations

import casadi as ca

from firmloop.design.tuning.error_integral import error_integral_rule

RULE = error_integral_rule(
    "itae",
    "least integral of the absolute error times the time since the step within a sensitivity peak",
    lambda e, t: t * ca.fabs(e),
)

"""IAE: the least integral of the absolute error, within limits on Ms, noise and actuator (`pid_search.py`)."""

from __future__ import annotations

import casadi as ca

from firmloop.design.tuning.error_integral import error_integral_rule

RULE = error_integral_rule(
    "iae", "least integral of the absolute error within a sensitivity peak", lambda e, _: ca.fabs(e)
)

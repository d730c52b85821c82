"""ISE: the least integral of the squared error, within limits on Ms, noise and actuator (`pid_search.py`)."""

from __future__ import annotations

from firmloop.design.tuning.error_integral import error_integral_rule

RULE = error_integral_rule("ise", "least integral of the squared error within a sensitivity peak", lambda e, _: e * e)

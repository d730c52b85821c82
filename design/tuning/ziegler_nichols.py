"""Ziegler and Nichols' rule from the reaction curve.

J. G. Ziegler and N. B. Nichols, "Optimum settings for automatic controllers", Trans. ASME 64 (1942) 759-768. With the
slope R and the delay L of the reaction curve (`reaction.py`)::

    P    Kc = 1/(R L)
    PI   Kc = 0.9/(R L)    Ti = 3.33 L
    PID  Kc = 1.2/(R L)    Ti = 2 L       Td = 0.5 L

The rule aims at a quarter-amplitude decay: fast against load, with little robustness (Ms is often above 2).
Key: `terms`, "p", "pi" (default) or "pid".
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from firmloop.design.law import DesignError
from firmloop.design.models.reaction import reaction
from firmloop.design.table import choice
from firmloop.design.tuning import Gains, Rule, ideal
from firmloop.identify.simulation.linearize import Linear

SETTINGS = {"p": (1.0, 0.0, 0.0), "pi": (0.9, 3.33, 0.0), "pid": (1.2, 2.0, 0.5)}  # Kc R L, Ti/L, Td/L


def tune(linear: Linear, period: float, table: Mapping[str, object]) -> Gains:
    """Gains for `linear` sampled every `period` s."""
    factor, integral, derivative = SETTINGS[choice(table, "terms", "pi", SETTINGS)]
    curve = reaction(linear, period)
    if math.isinf(curve.slope):
        raise DesignError(
            "Ziegler and Nichols' rule needs a plant whose answer has a slope, but this one is all there at once; use "
            'tune = "simc"'
        )
    says = f"Ziegler-Nichols on a reaction curve of slope {curve.slope:.4g}/s, delay {curve.delay:.4g} s"
    return ideal(factor / (curve.slope * curve.delay), integral * curve.delay, derivative * curve.delay, says)


RULE = Rule("ziegler_nichols", "Ziegler and Nichols' rule from the reaction curve", ("terms",), tune)

"""Ziegler and Nichols' rule from the ultimate gain and period.

J. G. Ziegler and N. B. Nichols, "Optimum settings for automatic controllers", Trans. ASME 64 (1942) 759-768. With Ku
and Tu of `reaction.py`, where the loop of a proportional controller swings for ever::

    P    Kc = 0.5 Ku
    PI   Kc = 0.45 Ku    Ti = Tu/1.2
    PID  Kc = 0.6 Ku     Ti = Tu/2      Td = Tu/8

Key: `terms`, "p", "pi" (default) or "pid".
"""

from __future__ import annotations

from collections.abc import Mapping

from firmloop.design.models.reaction import ultimate
from firmloop.design.table import choice
from firmloop.design.tuning import Gains, Rule, ideal
from firmloop.identify.simulation.linearize import Linear

SETTINGS = {"p": (0.5, 0.0, 0.0), "pi": (0.45, 1 / 1.2, 0.0), "pid": (0.6, 0.5, 0.125)}  # Kc/Ku, Ti/Tu, Td/Tu


def tune(linear: Linear, period: float, table: Mapping[str, object]) -> Gains:
    """Gains for `linear` sampled every `period` s."""
    factor, integral, derivative = SETTINGS[choice(table, "terms", "pi", SETTINGS)]
    point = ultimate(linear, period)
    says = f"Ziegler-Nichols on the ultimate gain {point.gain:.4g} and period {point.period:.4g} s"
    return ideal(factor * point.gain, integral * point.period, derivative * point.period, says)


RULE = Rule("ziegler_nichols_ultimate", "Ziegler and Nichols' rule from the ultimate point", ("terms",), tune)

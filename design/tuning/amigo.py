"""AMIGO: PI and PID settings that keep the sensitivity peak near 1.4.

K. J. Astrom and T. Hagglund, "Revisiting the Ziegler-Nichols step response method for PID control", J. Process
Control 14 (2004) 635-650 (PI: eq. 15 and 17; PID: eq. 19 and 21). For K exp(-L s)/(T s + 1)::

    PI   Kc = 0.15/K + (0.35 - L T/(L + T)^2) T/(K L)    Ti = 0.35 L + 13 L T^2/(T^2 + 12 L T + 7 L^2)
    PID  Kc = (0.2 + 0.45 T/L)/K    Ti = L (0.4 L + 0.8 T)/(L + 0.1 T)    Td = 0.5 L T/(0.3 L + T)

and for K exp(-L s)/s PI: Kc = 0.35/(K L), Ti = 13.4 L; PID: Kc = 0.45/(K L), Ti = 8 L, Td = 0.5 L. K, T and L are those
of the reaction curve (`reaction.py`), T and L by 63 %. Key: `terms`, "pi" (default) or "pid".
"""

from __future__ import annotations

from collections.abc import Mapping

from firmloop.design.models.reaction import reaction
from firmloop.design.table import choice
from firmloop.design.tuning import Gains, Rule, ideal
from firmloop.identify.simulation.linearize import Linear


def tune(linear: Linear, period: float, table: Mapping[str, object]) -> Gains:
    """Gains for `linear` sampled every `period` s."""
    terms = choice(table, "terms", "pi", ("pi", "pid"))
    curve = reaction(linear, period)
    late, lag = curve.delay, curve.lag
    if curve.integrates:
        says = f"AMIGO on gain/s {curve.slope:.4g}, delay {late:.4g} s"
        scale = 1 / (curve.slope * late)
        return (
            ideal(0.35 * scale, 13.4 * late, 0.0, says)
            if terms == "pi"
            else ideal(0.45 * scale, 8 * late, 0.5 * late, says)
        )
    says = f"AMIGO on gain {curve.gain:.4g}, lag {lag:.4g} s, delay {late:.4g} s"
    if terms == "pi":
        kc = (0.15 + (0.35 - late * lag / (late + lag) ** 2) * lag / late) / curve.gain
        ti = 0.35 * late + 13 * late * lag**2 / (lag**2 + 12 * late * lag + 7 * late**2)
        return ideal(kc, ti, 0.0, says)
    ti = late * (0.4 * late + 0.8 * lag) / (late + 0.1 * lag)
    return ideal((0.2 + 0.45 * lag / late) / curve.gain, ti, 0.5 * late * lag / (0.3 * late + lag), says)


RULE = Rule("amigo", "Astrom and Hagglund's rule for a sensitivity peak near 1.4", ("terms",), tune)

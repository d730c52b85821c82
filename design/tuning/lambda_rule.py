"""Lambda tuning: the closed loop answers with a time constant that the user chooses.

E. B. Dahlin, Instruments and Control Systems 41 (1968) 77-83; as PI and PID in K. J. Astrom and T. Hagglund, Advanced
PID Control (2006), section 6.5. For K exp(-L s)/(T s + 1)::

    PI   Kc = T/(K (lambda + L))                   Ti = T
    PID  Kc = (L/2 + T)/(K (L/2 + lambda))         Ti = T + L/2    Td = T L/(L + 2 T)

and for K exp(-L s)/s Kc = (2 lambda + L)/(K (lambda + L)^2), Ti = 2 lambda + L. The integral cancels the plant's lag:
load disturbances fade no faster than T. Keys: `lambda_s` (default T, or 3 L where that is longer) and `terms`, "pi"
(default) or "pid".
"""

from __future__ import annotations

from collections.abc import Mapping

from firmloop.design.law import DesignError
from firmloop.design.models.reaction import reaction
from firmloop.design.table import choice, positive
from firmloop.design.tuning import Gains, Rule, ideal
from firmloop.identify.simulation.linearize import Linear


def tune(linear: Linear, period: float, table: Mapping[str, object]) -> Gains:
    """Gains for `linear` sampled every `period` s."""
    terms = choice(table, "terms", "pi", ("pi", "pid"))
    curve = reaction(linear, period)
    late, lag = curve.delay, curve.lag
    wanted = positive(table, "lambda_s", 3 * late if curve.integrates else max(lag, 3 * late))
    if curve.integrates:
        if terms == "pid":
            raise DesignError("lambda tuning has no PID for a plant that integrates; give terms = 'pi'")
        says = f"lambda tuning on gain/s {curve.slope:.4g}, delay {late:.4g} s, lambda {wanted:.4g} s"
        return ideal((2 * wanted + late) / (curve.slope * (wanted + late) ** 2), 2 * wanted + late, 0.0, says)
    if lag <= 0:
        raise DesignError('lambda tuning needs a plant with a lag, but this one is a delay alone; use tune = "simc"')
    says = f"lambda tuning on gain {curve.gain:.4g}, lag {lag:.4g} s, delay {late:.4g} s, lambda {wanted:.4g} s"
    if terms == "pi":
        return ideal(lag / (curve.gain * (wanted + late)), lag, 0.0, says)
    kc = (late / 2 + lag) / (curve.gain * (late / 2 + wanted))
    return ideal(kc, lag + late / 2, lag * late / (late + 2 * lag), says)


RULE = Rule("lambda", "lambda tuning: a closed-loop time constant of the user's choice", ("lambda_s", "terms"), tune)

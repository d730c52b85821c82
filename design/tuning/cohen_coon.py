"""Cohen and Coon's rule: a quarter-amplitude decay on a first-order model with delay.

G. H. Cohen and G. A. Coon, "Theoretical consideration of retarded control", Trans. ASME 75 (1953) 827-834. For
K exp(-L s)/(T s + 1) and r = L/T::

    P    Kc = (1 + r/3)/(K r)
    PI   Kc = (0.9 + r/12)/(K r)    Ti = L (30 + 3 r)/(9 + 20 r)
    PID  Kc = (4/3 + r/4)/(K r)     Ti = L (32 + 6 r)/(13 + 8 r)    Td = 4 L/(11 + 2 r)

K, T and L are those of the reaction curve (`reaction.py`). Key: `terms`, "p", "pi" (default) or "pid".
"""

from __future__ import annotations

from collections.abc import Mapping

from firmloop.design.law import DesignError
from firmloop.design.models.reaction import reaction
from firmloop.design.table import choice
from firmloop.design.tuning import Gains, Rule, ideal
from firmloop.identify.simulation.linearize import Linear


def tune(linear: Linear, period: float, table: Mapping[str, object]) -> Gains:
    """Gains for `linear` sampled every `period` s."""
    terms = choice(table, "terms", "pi", ("p", "pi", "pid"))
    curve = reaction(linear, period)
    if curve.integrates or curve.lag <= 0:
        what = "integrates" if curve.integrates else "is a delay without a lag"
        raise DesignError(f'Cohen and Coon\'s rule needs a plant with a lag, but this one {what}; use tune = "simc"')
    r, delay = curve.delay / curve.lag, curve.delay
    says = f"Cohen-Coon on gain {curve.gain:.4g}, lag {curve.lag:.4g} s, delay {delay:.4g} s"
    scale = 1 / (curve.gain * r)
    if terms == "p":
        return ideal(scale * (1 + r / 3), 0.0, 0.0, says)
    if terms == "pi":
        return ideal(scale * (0.9 + r / 12), delay * (30 + 3 * r) / (9 + 20 * r), 0.0, says)
    return ideal(scale * (4 / 3 + r / 4), delay * (32 + 6 * r) / (13 + 8 * r), 4 * delay / (11 + 2 * r), says)


RULE = Rule("cohen_coon", "Cohen and Coon's rule from the reaction curve", ("terms",), tune)

"""Pole placement: the closed loop's poles where the user wants them.

K. J. Astrom and T. Hagglund, Advanced PID Control (2006), section 6.4. With the plant as K/(a2 s^2 + a1 s + a0)
(`lag_model.py`) a PI gives a first-order plant s^2 + 2 zeta w s + w^2, a PID a second-order one (s + alpha w) times
that::

    PI   kp = (2 zeta w a1 - a0)/K                          ki = w^2 a1/K
    PID  kp = (w^2 (1 + 2 zeta alpha) a2 - a0)/K            ki = alpha w^3 a2/K     kd = ((2 zeta + alpha) w a2 - a1)/K

Delay, hold and what the model leaves out are not placed; hence the default w = 0.25/theta, theta their sum: at the
crossover (1.7 w) they take 25 degrees of phase.

Keys: `natural_frequency_rad_s` (w), `damping_ratio` (zeta, default 0.8), `alpha` (default 1), `terms`, "pi" (default)
or "pid".
"""

from __future__ import annotations

from collections.abc import Mapping

from firmloop.design.law import DesignError
from firmloop.design.models.lag_model import lag_model
from firmloop.design.table import choice, positive
from firmloop.design.tuning import Gains, Rule
from firmloop.identify.simulation.linearize import Linear


def tune(linear: Linear, period: float, table: Mapping[str, object]) -> Gains:
    """Gains for `linear` sampled every `period` s."""
    terms = choice(table, "terms", "pi", ("pi", "pid"))
    model = lag_model(linear, period, 2 if terms == "pid" else 1)
    w = positive(table, "natural_frequency_rad_s", 0.25 / model.delay)
    zeta, alpha = positive(table, "damping_ratio", 0.8), positive(table, "alpha", 1.0)
    says = f"poles at {w:.4g} rad/s, damping {zeta:.3g}, on {model.says()}"
    if terms == "pi":
        kp, ki, kd = 2 * zeta * w * model.a1 - model.a0, w**2 * model.a1, 0.0
    else:
        kp = w**2 * (1 + 2 * zeta * alpha) * model.a2 - model.a0
        ki, kd = alpha * w**3 * model.a2, (2 * zeta + alpha) * w * model.a2 - model.a1
    if kp < 0 or kd < 0:
        raise DesignError(
            f"the poles asked for ({w:.4g} rad/s) are slower than the plant's own, which takes a negative gain; give a "
            "larger natural_frequency_rad_s, or another rule where the delay forbids it"
        )
    return Gains(kp / model.gain, ki / model.gain, kd / model.gain, says)


RULE = Rule(
    "pole_placement",
    "closed-loop poles where the user wants them",
    ("natural_frequency_rad_s", "damping_ratio", "alpha", "terms"),
    tune,
)

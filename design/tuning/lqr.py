"""LQR: the PI or PID that minimizes a quadratic cost on the reduced plant.

With the plant as K/(a2 s^2 + a1 s + a0) (`lag_model.py`), its output y, the slope of it and the integral I of the
error as states, u = -kp y - kd y' + ki I minimizes

    integral of y^2 + q I^2 + rho u^2

(B. D. O. Anderson and J. B. Moore, Optimal Control, 1990, section 2.3). Because the state is all measured, the PID is
the full state feedback. Keys: `effort_weight` (rho, default what puts the crossover near 0.3/theta, theta being
delay, hold and what the model leaves out), `integral_weight` (q in 1/s^2, by default rho ki^2 with K ki = w + (a1 w^2
+ a2 w^3)/4, w = 0.3/theta: ki = sqrt(q/rho) is what the cost leads to), `terms`, "pi" (default) or "pid".
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import scipy

from firmloop.design.law import DesignError
from firmloop.design.models.lag_model import lag_model
from firmloop.design.table import choice, positive
from firmloop.design.tuning import Gains, Rule
from firmloop.identify.simulation.linearize import Linear


def tune(linear: Linear, period: float, table: Mapping[str, object]) -> Gains:
    """Gains for `linear` sampled every `period` s."""
    terms = choice(table, "terms", "pi", ("pi", "pid"))
    order = 2 if terms == "pid" else 1
    model = lag_model(linear, period, order)
    w = 0.3 / model.delay
    leading = model.a2 if order == 2 else model.a1
    rho = positive(table, "effort_weight", (model.gain / (leading * w**order)) ** 2)
    integral = (model.a2 * w**3 / 4 + model.a1 * w**2 / 4 + model.a0 * w) / model.gain
    q = positive(table, "integral_weight", rho * integral**2)
    # Time in units of 1/w, so that the Riccati equation is well scaled for a plant of any speed.
    a = np.zeros((order + 1, order + 1))
    a[:order, :order] = (
        np.array([[-model.a0 / (model.a1 * w)]])
        if order == 1
        else np.array([[0.0, 1.0], [-model.a0 / (model.a2 * w**2), -model.a1 / (model.a2 * w)]])
    )
    a[order, 0] = -1.0
    b = np.zeros((order + 1, 1))
    b[order - 1] = model.gain / (leading * w**order)
    weight = np.zeros((order + 1, order + 1))
    weight[0, 0], weight[order, order] = 1.0, q / w**2
    try:
        solution = scipy.linalg.solve_continuous_are(a, b, weight, np.array([[rho]]))
    except (np.linalg.LinAlgError, ValueError) as error:
        raise DesignError(
            f"the weights of lqr have no solution ({str(error).rstrip('.').lower()}); change them"
        ) from None
    gain = (b.T @ solution)[0] / rho
    says = f"LQR, effort {rho:.4g}, integral {q:.4g}/s^2, on {model.says()}"
    return Gains(float(gain[0]), float(-gain[order] * w), float(gain[1] / w) if order == 2 else 0.0, says)


RULE = Rule("lqr", "least quadratic cost on the reduced plant", ("effort_weight", "integral_weight", "terms"), tune)

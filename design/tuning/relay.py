"""Relay auto-tuning: let a relay make the loop swing, and read the ultimate point off the oscillation.

K. J. Astrom and T. Hagglund, "Automatic tuning of simple regulators with specifications on phase and amplitude
margins", Automatica 20 (1984) 645-651. A relay of amplitude d and hysteresis e makes the sampled plant swing with the
amplitude a and the period Tu; by its describing function Ku = 4 d / (pi sqrt(a^2 - e^2)). The settings are then those
of Ziegler and Nichols for the ultimate point, or of Tyreus and Luyben (Ind. Eng. Chem. Res. 31 (1992) 2625-2628)::

    ziegler_nichols   PI  Kc = 0.45 Ku  Ti = Tu/1.2      PID  Kc = 0.6 Ku   Ti = Tu/2    Td = Tu/8
    tyreus_luyben     PI  Kc = Ku/3.2   Ti = 2.2 Tu      PID  Kc = Ku/2.2   Ti = 2.2 Tu  Td = Tu/6.3

The experiment is run on the model here, with the controller's own period, so that what is read off holds what a relay
on the bench would show: an approximation of the ultimate point, about 5 % for most plants and up to a third where the
oscillation lasts only a few samples. Keys: `terms`, "pi" (default) or "pid"; `settings` (default tyreus_luyben);
`relay_amplitude` in the output's unit and `hysteresis` in the measurement's (default 1 and 0).
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from firmloop.design.discretize.zero_order_hold import state_space, zero_order_hold
from firmloop.design.law import DesignError
from firmloop.design.models.process import process, zero_pole
from firmloop.design.models.reaction import Ultimate, model_gain
from firmloop.design.table import choice, positive, real
from firmloop.design.tuning import Gains, Rule, ideal
from firmloop.identify.simulation.linearize import Linear

Array = npt.NDArray[np.float64]

SETTINGS = {
    ("ziegler_nichols", "pi"): (0.45, 1 / 1.2, 0.0),
    ("ziegler_nichols", "pid"): (0.6, 0.5, 0.125),
    ("tyreus_luyben", "pi"): (1 / 3.2, 2.2, 0.0),
    ("tyreus_luyben", "pid"): (1 / 2.2, 2.2, 1 / 6.3),
}  # Kc/Ku, Ti/Tu, Td/Tu
CYCLES = 12  # full periods of the relay that are waited for; the last four are measured
MOST_SAMPLES = 200_000


def tune(linear: Linear, period: float, table: Mapping[str, object]) -> Gains:
    """Gains for `linear` sampled every `period` s."""
    terms = choice(table, "terms", "pi", ("pi", "pid"))
    settings = choice(table, "settings", "tyreus_luyben", ("tyreus_luyben", "ziegler_nichols"))
    amplitude, hysteresis = positive(table, "relay_amplitude", 1.0), real(table, "hysteresis", 0.0, 0.0)
    point = relay_experiment(linear, period, amplitude, hysteresis)
    factor, integral, derivative = SETTINGS[settings, terms]
    says = f"relay experiment ({settings}): ultimate gain {point.gain:.4g}, period {point.period:.4g} s"
    return ideal(factor * point.gain, integral * point.period, derivative * point.period, says)


def relay_experiment(linear: Linear, period: float, amplitude: float, hysteresis: float) -> Ultimate:
    """Run the relay on the sampled plant until it swings; read gain and period off the last cycles."""
    process(zero_pole(linear), period)
    a, b, c = state_space(zero_order_hold(linear, period))
    sign = math.copysign(1.0, model_gain(linear))
    x = np.zeros(len(a))
    drive, rises = amplitude * sign, [0]
    seen: list[float] = []
    while len(rises) <= CYCLES and len(seen) < MOST_SAMPLES:
        y = float((c @ x)[0])
        seen.append(y)
        if drive * sign > 0 and y > hysteresis:
            drive = -drive
        elif drive * sign < 0 and y < -hysteresis:
            drive = -drive
            rises.append(len(seen))
        x = a @ x + b[:, 0] * drive
    if len(rises) <= CYCLES:
        raise DesignError(
            f"the relay of amplitude {amplitude:g} does not make the plant swing within {MOST_SAMPLES} samples; give a "
            "larger relay_amplitude or a smaller hysteresis"
        )
    last = seen[rises[-5] : rises[-1]]
    height = (max(last) - min(last)) / 2
    if height <= hysteresis:
        raise DesignError(
            f"the relay's oscillation of {height:g} is within its hysteresis {hysteresis:g}; make it smaller"
        )
    size = 4 * amplitude / (math.pi * math.sqrt(height**2 - hysteresis**2))
    return Ultimate(sign * size, (rises[-1] - rises[-5]) / 4 * period)


RULE = Rule(
    "relay",
    "relay auto-tuning, run on the model",
    ("terms", "settings", "relay_amplitude", "hysteresis"),
    tune,
)

"""SIMC: PI or PID from a first- or second-order model with delay.

S. Skogestad, "Simple analytic rules for model reduction and PID controller tuning", J. Process Control 13 (2003)
291-309, table 1. For k exp(-theta s) / ((tau1 s + 1)(tau2 s + 1)) and a closed loop of time constant tau_c, as a
series PID::

    Kc = tau1 / (k (tau_c + theta))    tau_I = min(tau1, 4 (tau_c + theta))    tau_D = tau2

for k exp(-theta s) / (s (tau2 s + 1)) Kc = 1 / (k (tau_c + theta)), tau_I = 4 (tau_c + theta), tau_D = tau2, and for
k exp(-theta s) / s^2 Kc = 1 / (4 k (tau_c + theta)^2), tau_I = tau_D = 4 (tau_c + theta). The parallel gains follow as
kp = Kc (1 + tau_D/tau_I), ki = Kc/tau_I, kd = Kc tau_D. theta holds the plant's delay, what the half rule adds, and
half a sample for the hold.

Keys: `tau_c_s` (default theta: tight and still robust, Ms about 1.6) and `terms`, "pi" or "pid" (default: "pid" where
the second lag is longer than theta, as Skogestad recommends, and where the two lags stand for a complex pair).

With a derivative, theta also holds its filter's time constant, `tf_s` or Td/10: a plant without delay would otherwise
be promised a closed loop that the filter cannot follow. For a lag shorter than a sample theta holds another half
sample: the integral then does the work alone, and the law adds e[k] to it only for the next sample.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

from firmloop.design.law import DesignError
from firmloop.design.models.process import Process, half_rule, natural_period, process, zero_pole
from firmloop.design.table import choice, positive, real
from firmloop.design.tuning import Gains, Rule
from firmloop.identify.simulation.linearize import Linear

ROUNDS = 60  # the filter follows from the gains and the gains from the filter; each round halves the rest at least


def tune(linear: Linear, period: float, table: Mapping[str, object]) -> Gains:
    """Gains for `linear` sampled every `period` s."""
    plant = zero_pole(linear)
    full = process(plant, period)
    second = half_rule(full, 2)
    lag2 = second.lags[-1] if second.lags and len(second.lags) + second.integrators == 2 else 0.0
    natural = natural_period(plant, full)
    usual = "pid" if second.integrators >= 2 or lag2 > second.delay or natural > 0 else "pi"
    terms = choice(table, "terms", usual, ("pi", "pid"))
    model = second if terms == "pid" else half_rule(full, 1)
    if model.integrators > 2 or (model.integrators == 2 and terms == "pi"):
        raise DesignError(
            f"the plant has {model.integrators} integrators, which terms = '{terms}' cannot stabilize; "
            + ("give terms = 'pid'" if model.integrators == 2 else "give kp, ki, kd instead")
        )
    single = terms == "pi" or not model.lags
    if single and not model.integrators and max(model.lags, default=0.0) < period:
        model = replace(model, delay=model.delay + period / 2)
    gains, slowed = Gains(0.0, 0.0, 0.0, ""), model
    for _ in range(ROUNDS if terms == "pid" else 1):
        filtered = real(table, "tf_s", gains.filter_time) if terms == "pid" else 0.0
        slowed = replace(model, delay=model.delay + filtered)
        tau_c = positive(table, "tau_c_s", slowed.delay)
        pair = terms == "pid" and natural > 0
        gains = simc_pair(slowed, natural, tau_c) if pair else simc(slowed, tau_c)
    return gains


def simc(model: Process, tau_c: float) -> Gains:
    """Table 1 of the source for a model of at most second order; `tau_c` in s."""
    total = tau_c + model.delay
    lags = (*model.lags, 0.0, 0.0)
    if model.integrators == 2:
        kc, tau_i, tau_d = 1 / (4 * model.gain * total**2), 4 * total, 4 * total
    elif model.integrators == 1:
        kc, tau_i, tau_d = 1 / (model.gain * total), 4 * total, lags[0]
    else:
        # Kc/tau_I has a limit where the plant has no lag at all: then the controller is a pure integral
        kc, tau_i, tau_d = lags[0] / (model.gain * total), min(lags[0], 4 * total), lags[1]
    ki = kc / tau_i if tau_i > 0 else 1 / (model.gain * total)
    kp = kc + ki * tau_d
    gains = (kp, ki, kc * tau_d)
    if not all(math.isfinite(gain) for gain in gains):
        raise DesignError(
            f"simc gives no finite gains for a plant gain of {model.gain:g}; check the plant's parameters"
        )
    return Gains(float(kp), float(ki), float(kc * tau_d), _says(model, tau_c))


def simc_pair(model: Process, natural: float, tau_c: float) -> Gains:
    """Settle k exp(-theta s) / (tau^2 s^2 + 2 zeta tau s + 1), tau = `natural` in s (section 5 of the source).

    The zeros of the parallel PID cancel the pair: ki = 1 / (k (tau_c + theta)), kp = 2 zeta tau ki, kd = tau^2 ki. The
    two lags of `model` stand for 2 zeta tau.
    """
    ki = 1 / (model.gain * (tau_c + model.delay))
    return Gains(float(ki * sum(model.lags)), float(ki), float(ki * natural**2), _says(model, tau_c))


def _says(model: Process, tau_c: float) -> str:
    """Tell the model in one line."""
    names = {0: "gain", 1: "gain/s", 2: "gain/s^2"}[model.integrators]
    lags = "".join(f", lag {lag:.4g} s" for lag in model.lags)
    return f"SIMC on {names} {model.gain:.4g}{lags}, delay {model.delay:.4g} s, tau_c {tau_c:.4g} s"


RULE = Rule("simc", "Skogestad's rules on the half-rule model", ("tau_c_s", "terms"), tune)

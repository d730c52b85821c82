"""Make a tuning rule of an error integral: ISE, IAE and ITAE differ by one line each."""

from __future__ import annotations

import math
from collections.abc import Mapping

from firmloop.design.law import DesignError
from firmloop.design.models.process import half_rule, natural_period, process, zero_pole
from firmloop.design.table import choice, positive, real
from firmloop.design.tuning import Gains, Rule
from firmloop.design.tuning.pid_search import Cost, GainTriple, RobustnessLimits, Task, run_length, search
from firmloop.design.tuning.simc import tune as simc
from firmloop.identify.simulation.linearize import Linear

KEYS = ("terms", "ms_max", "noise_gain_max", "step", "load")
SLOWER = tuple(2.0**k for k in range(9))  # times SIMC's own tau_c: the first that keeps the limits is where to start


def error_integral_rule(name: str, says: str, cost: Cost) -> Rule:
    """Return the rule called `name` that minimizes the sum of `cost`.

    Its keys: `terms` "pi" or "pid" (default: what SIMC would choose), `ms_max` (default 1.6), `noise_gain_max` (rms of
    the output over rms of the measurement's noise, default no limit), `step` of the reference and `load` at the plant's
    input (defaults: a quarter of the reference's range, or what takes half of the output's room; a quarter of that
    room). Where the output cannot go both ways from 0, the loop is taken to work around the middle of its range.
    """

    def tune(linear: Linear, period: float, table: Mapping[str, object]) -> Gains:
        full = process(zero_pole(linear), period)
        usual = "pid" if _derivative_pays(linear, period) else "pi"
        terms = choice(table, "terms", usual, ("pi", "pid"))
        limits = RobustnessLimits(
            real(table, "ms_max", 1.6, 1.05),
            positive(table, "noise_gain_max", None) if "noise_gain_max" in table else math.inf,
        )
        u_min, u_max = real(table, "u_min", -1e30), real(table, "u_max", 1e30)
        middle = 0.0 if u_min < 0 < u_max else (u_min + u_max) / 2  # of a one-sided output the loop works around it
        u_min, u_max = u_min - middle, u_max - middle
        room = u_max if full.gain > 0 else -u_min
        usual_step = real(table, "usual_step", 1.0)
        reach = math.inf if full.integrators else abs(full.gain) * room / 2
        step = positive(table, "step", min(abs(usual_step), reach))
        load = positive(table, "load", min(room / 4, 1e29))
        if not full.integrators and (step / abs(full.gain) + load) > room:
            raise DesignError(
                f"controller.step = {step:g} with load = {load:g} takes an output of {step / abs(full.gain) + load:g}, "
                f"but it ends at {room:g}; give smaller ones"
            )
        task = Task(
            linear,
            period,
            table,
            u_min,
            u_max,
            step,
            -math.copysign(load, full.gain),
            run_length(half_rule(full, 1), period),
        )
        points = tuple(_start(linear, period, table, terms, slower) for slower in SLOWER)
        kp, ki, kd = search(task, cost, limits, points)
        around = f" around an output of {middle:.4g}" if middle else ""
        says = f"least {name.upper()} of a step of {step:.4g} and a load of {load:.4g}{around}, Ms <= {limits.ms:g}"
        return Gains(kp, ki, kd, says)

    return Rule(name, says, KEYS, tune)


def _derivative_pays(linear: Linear, period: float) -> bool:
    plant = zero_pole(linear)
    full = process(plant, period)
    second = half_rule(full, 2)
    lag2 = second.lags[-1] if second.lags and len(second.lags) + second.integrators == 2 else 0.0
    return second.integrators >= 2 or lag2 > second.delay or natural_period(plant, full) > 0


def _start(linear: Linear, period: float, table: Mapping[str, object], terms: str, slower: float) -> GainTriple:
    """SIMC with a slower closed loop; a PID for a plant of one lag starts with a small derivative."""
    own: dict[str, object] = {"terms": terms} | ({"tf_s": table["tf_s"]} if "tf_s" in table else {})
    model = process(zero_pole(linear), period)
    gains = simc(linear, period, {**own, "tau_c_s": slower * (half_rule(model, 1).delay)})
    if terms == "pid" and gains.kd == 0:
        return gains.kp, gains.ki, gains.kp * model.delay / 10
    return gains.kp, gains.ki, gains.kd

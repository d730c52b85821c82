"""Read a model off a step response by hand's old rules: a few points of the curve, no fit.

With t_p the time at which the response has made p of its whole change:

- 63 %: tau = t_0.632 of a lag without delay, the definition of a time constant.
- Two points (C. L. Smith, Digital Computer Process Control, 1972): tau = 1.5 (t_0.632 - t_0.283), delay = t_0.632 -
tau.
- Sundaresan and Krishnaswamy (Can. J. Chem. Eng. 56 (1978) 257-262): tau = 0.67 (t_0.853 - t_0.353),
  delay = 1.3 t_0.353 - 0.29 t_0.853.
- Overshoot (K. Ogata, Modern Control Engineering, section 5-3): with M the overshoot and t_p the time of the peak,
  zeta = -ln M/sqrt(pi^2 + ln^2 M), wn = pi/(t_p sqrt(1 - zeta^2)). Only where there is an overshoot.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from firmloop.identify.bench_tests.step_response import StepResponse, reach, smooth_share, step_figures
from firmloop.identify.error import IdentifyError


@dataclass(frozen=True, slots=True)
class Method:
    """One way to read `parameters` (names of a plant of `kind`) off a response."""

    name: str
    kind: str
    read: Callable[[StepResponse], Mapping[str, float]]


def one_point(response: StepResponse) -> Mapping[str, float]:
    """63 %."""
    return {"gain": response.gain, "time_constant_s": _at(response, 1 - math.exp(-1)), "delay_s": 0.0}


def two_point(response: StepResponse) -> Mapping[str, float]:
    """28.3 % and 63.2 %."""
    early, late = _at(response, 1 - math.exp(-1 / 3)), _at(response, 1 - math.exp(-1))
    tau = 1.5 * (late - early)
    return {"gain": response.gain, "time_constant_s": tau, "delay_s": max(late - tau, 0.0)}


def sundaresan(response: StepResponse) -> Mapping[str, float]:
    """35.3 % and 85.3 %."""
    early, late = _at(response, 0.353), _at(response, 0.853)
    delay = 1.3 * early - 0.29 * late
    return {"gain": response.gain, "time_constant_s": 0.67 * (late - early), "delay_s": max(delay, 0.0)}


def overshoot(response: StepResponse) -> Mapping[str, float]:
    """Height and time of the first peak.

    Raises IdentifyError where the response has none.
    """
    figures = step_figures(response)
    if figures.overshoot_percent <= 0.0:
        raise IdentifyError(
            f"{response.source}: the response has no overshoot to read a damping off; a model with zeta >= 1 or of "
            "first order fits it"
        )
    damping = -math.log(figures.overshoot_percent / 100.0)
    zeta = damping / math.hypot(math.pi, damping)
    natural = math.pi / (figures.peak_s * math.sqrt(1.0 - zeta**2))
    return {"gain": response.gain, "natural_frequency_rad_s": natural, "damping_ratio": zeta, "delay_s": 0.0}


METHODS = (
    Method("63 %", "first_order", one_point),
    Method("two points", "first_order", two_point),
    Method("Sundaresan-Krishnaswamy", "first_order", sundaresan),
    Method("overshoot", "second_order", overshoot),
)


def _at(response: StepResponse, level: float) -> float:
    """Time of a level, s; IdentifyError where the sampling is too coarse to see the rise."""
    found = reach(response.time, smooth_share(response), level)
    step = float(response.time[1] - response.time[0])
    if found < 2 * step:
        raise IdentifyError(
            f"{response.source}: the response has made {100 * level:.3g} % of its way within {found / step:.2g} "
            "samples; record it at least ten times faster"
        )
    return found

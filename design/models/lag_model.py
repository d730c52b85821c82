"""A plant as gain / (a2 s^2 + a1 s + a0): what rules that place poles start from, by the half rule of `process.py`."""

from __future__ import annotations

from dataclasses import dataclass

from firmloop.design.law import DesignError
from firmloop.design.models.process import BY_HAND, half_rule, natural_period, process, zero_pole
from firmloop.identify.simulation.linearize import Linear


@dataclass(frozen=True, slots=True)
class LagModel:
    """K / (a2 s^2 + a1 s + a0), a0 being 1 or, where the plant integrates, 0; `delay` is what the model leaves out."""

    gain: float  # K
    a2: float  # s^2
    a1: float  # s
    a0: float
    delay: float  # s

    def says(self) -> str:
        """Tell the model in a few words."""
        return f"gain {self.gain:.4g} over {self.a2:.4g} s^2 + {self.a1:.4g} s + {self.a0:g}, delay {self.delay:.4g} s"


def lag_model(linear: Linear, period: float, order: int) -> LagModel:
    """Reduce the plant behind a hold of `period` s to `order` 1 or 2; a complex pair is kept as it is."""
    plant = zero_pole(linear)
    full = process(plant, period)
    kept = half_rule(full, order)
    if kept.integrators > order:
        raise DesignError("the plant integrates twice, which terms = 'pi' cannot stabilize; give terms = 'pid'")
    natural = natural_period(plant, full)
    total = sum(kept.lags)
    if order == 1:
        if kept.integrators:
            return LagModel(kept.gain, 0.0, 1.0, 0.0, kept.delay)
        if not kept.lags:
            raise DesignError(f"the plant is a gain without a lag; {BY_HAND}")
        return LagModel(kept.gain, 0.0, total, 1.0, kept.delay)
    if kept.integrators == 2:
        return LagModel(kept.gain, 1.0, 0.0, 0.0, kept.delay)
    if len(kept.lags) + kept.integrators < 2:
        raise DesignError("the plant has a single lag, for which a derivative has nothing to do; give terms = 'pi'")
    if kept.integrators:
        return LagModel(kept.gain, kept.lags[0], 1.0, 0.0, kept.delay)
    product = natural**2 if natural else kept.lags[0] * kept.lags[1]
    return LagModel(kept.gain, product, total, 1.0, kept.delay)

"""An actuator that ends at a limit: the input is clipped."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from firmloop.identify.plants.assembly import Array, Assembly
from firmloop.identify.plants.effect import Effect, EffectParameter, Scales, Site, ceiling, ended


def parameters(site: Site) -> tuple[EffectParameter, ...]:
    """Name the constants."""
    return (ceiling(ended("limit", site.input), site.input_unit),)


def starts(site: Site, scales: Scales) -> tuple[tuple[float, ...], ...]:
    """Propose where a fit begins."""
    return ((0.9 * scales.input,), (0.7 * scales.input,))


def believable(values: Sequence[float], scales: Scales) -> bool:
    """Tell whether something is left of what the command does: below all of it a limit makes a constant of it."""
    return values[0] > scales.least


def clipped(value: Array, limit: float) -> Array:
    """End commands at a limit."""
    return np.asarray(np.clip(value, -limit, limit))


def attach(assembly: Assembly, site: Site, values: tuple[float, ...]) -> None:
    """Add it to a simulation."""
    assembly.map_input(clipped, values[0], "fmin(fmax(u, -size), size)")


EFFECT = Effect(
    name="input_saturation",
    equation="actuator",
    place="actuator",
    term="clip(u, -limit, limit)",
    says="the actuator gives no more than a limit",
    parameters=parameters,
    starts=starts,
    confusable_with=("supply_sag", "slew_rate_limit"),
    experiment="steps above and below the suspected limit",
    rotary_only=False,
    needs_position=False,
    attach=attach,
    believable=believable,
    codes=(),
    switches=(0,),
    unmet="what the actuator does not give cannot be asked for; set u_min and u_max to its limits",
    coordinate="large input",
    limits=True,
    stage=2,
)

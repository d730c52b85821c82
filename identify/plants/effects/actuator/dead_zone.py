"""An actuator that ignores small commands: the input is shrunk by a half width about where the plant rests."""

from __future__ import annotations

import numpy as np

from firmloop.identify.plants.assembly import Array, Assembly
from firmloop.identify.plants.effect import Effect, EffectParameter, Holding, Scales, Site, ended, size


def parameters(site: Site) -> tuple[EffectParameter, ...]:
    """Name the constants."""
    return (size(ended("half_width", site.input), site.input_unit),)


def starts(site: Site, scales: Scales) -> tuple[tuple[float, ...], ...]:
    """Propose where a fit begins."""
    return ((0.03 * scales.input,), (0.1 * scales.input,))


def shrunk(value: Array, half_width: float) -> Array:
    """Take a half width from commands, and all of those within it."""
    return np.asarray(value - np.clip(value, -half_width, half_width))


def attach(assembly: Assembly, site: Site, values: tuple[float, ...]) -> None:
    """Add it to a simulation."""
    assembly.map_input(shrunk, values[0], "u - fmin(fmax(u, -size), size)", assembly.resting_input())


def holding(site: Site, values: tuple[float, ...]) -> Holding:
    """Return what meets it."""
    return Holding(dead=values[0])


EFFECT = Effect(
    name="dead_zone",
    equation="actuator",
    place="actuator",
    term="u - clip(u, -h, h)",
    says="the actuator does not answer small commands",
    parameters=parameters,
    starts=starts,
    confusable_with=("brush_drop", "coulomb_friction", "backlash"),
    experiment="a staircase of small commands around zero with the shaft locked",
    rotary_only=False,
    needs_position=False,
    attach=attach,
    codes=(),
    switches=(0,),
    holding=holding,
    coordinate="input near zero",
    stage=1,
)

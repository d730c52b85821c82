"""A sensor whose scale is off: g y."""

from __future__ import annotations

import math
from collections.abc import Mapping

from firmloop.identify.plants.assembly import Assembly
from firmloop.identify.plants.effect import Effect, EffectParameter, Scales, Site


def parameters(site: Site) -> tuple[EffectParameter, ...]:
    """Name the constants."""
    return (EffectParameter("gain", "", -math.inf, math.inf, 1.0, False, None),)


def starts(site: Site, scales: Scales) -> tuple[tuple[float, ...], ...]:
    """Propose where a fit begins."""
    return ((1.05,), (0.95,))


def attach(assembly: Assembly, site: Site, values: tuple[float, ...]) -> None:
    """Add it to a simulation."""
    assembly.map_output(site.output, "sensor_gain", values)


def undo(values: Mapping[str, float], reading: float) -> float:
    """Return what a reading is without it."""
    return reading / values["gain"] if values["gain"] else reading


EFFECT = Effect(
    name="sensor_gain",
    equation="sensor",
    place="sensor",
    term="g y",
    says="the sensor's scale is off",
    parameters=parameters,
    starts=starts,
    confusable_with=(),
    experiment="a known current, speed or angle for comparison",
    rotary_only=False,
    needs_position=False,
    attach=attach,
    codes=(
        (
            "sensor_gain",
            """    return v->y * q[0];""",
        ),
    ),
    switches=(0,),
    stage=5,
    straight=True,
    per_recording="gain",
    undo=undo,
)

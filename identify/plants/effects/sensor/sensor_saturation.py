"""A sensor that ends at a limit: clipped."""

from __future__ import annotations

from dataclasses import replace

from firmloop.identify.plants.assembly import Assembly
from firmloop.identify.plants.effect import Effect, EffectParameter, Scales, Site, ceiling, ended

_ROUNDED = 1e-3  # of the largest reading, by which the limit itself may lie above it


def parameters(site: Site) -> tuple[EffectParameter, ...]:
    """Name the constants."""
    return (ceiling(ended("limit", site.output_ending), site.output_unit),)


def starts(site: Site, scales: Scales) -> tuple[tuple[float, ...], ...]:
    """Propose where a fit begins."""
    return ((scales.plateau,), (0.8 * scales.output,))


def attach(assembly: Assembly, site: Site, values: tuple[float, ...]) -> None:
    """Add it to a simulation."""
    assembly.map_output(site.output, "sensor_saturation", values)


def bounded(parameter: EffectParameter, scales: Scales) -> EffectParameter:
    """Bound the limit by the largest reading: a limit above that, and above what rounding takes off, is none.

    Nor is one below where readings rest to the last digit.
    """
    return replace(parameter, low=scales.rested, high=min(parameter.high, scales.output * (1.0 + _ROUNDED)))


EFFECT = Effect(
    name="sensor_saturation",
    equation="sensor",
    place="sensor",
    term="clip(y, -limit, limit)",
    says="the sensor shows no more than a limit",
    parameters=parameters,
    starts=starts,
    confusable_with=("input_saturation",),
    experiment="motion within and beyond the suspected limit",
    rotary_only=False,
    needs_position=False,
    attach=attach,
    codes=(
        (
            "sensor_saturation",
            """    return fmin(fmax(v->y, -q[0]), q[0]);""",
        ),
    ),
    switches=(0,),
    bounded=bounded,
    limits=True,
    stage=8,
)

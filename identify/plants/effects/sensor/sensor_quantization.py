"""A sensor that reads in steps: rounded to a resolution."""

from __future__ import annotations

from firmloop.identify.plants.assembly import Assembly
from firmloop.identify.plants.effect import Effect, EffectParameter, Scales, Site, ended, size


def parameters(site: Site) -> tuple[EffectParameter, ...]:
    """Name the constants."""
    return (size(ended("resolution", site.output_ending), site.output_unit),)


def starts(site: Site, scales: Scales) -> tuple[tuple[float, ...], ...]:
    """Propose where a fit begins."""
    return ((0.01 * scales.output,),)


def attach(assembly: Assembly, site: Site, values: tuple[float, ...]) -> None:
    """Add it to a simulation."""
    assembly.map_output(site.output, "sensor_quantization", values)


EFFECT = Effect(
    name="sensor_quantization",
    equation="sensor",
    place="sensor",
    term="round(y / r) r",
    says="the sensor reads in coarse steps",
    parameters=parameters,
    starts=starts,
    confusable_with=("cogging_torque",),
    experiment="very slow motion, to see the steps one by one",
    rotary_only=False,
    needs_position=False,
    attach=attach,
    codes=(
        (
            "sensor_quantization",
            """    return q[0] * floor(v->y / q[0] + 0.5);""",
        ),
    ),
    switches=(0,),
    stage=10,
    seen_by="steps",
)

"""A reading that wraps around at a range, like an overflowing counter."""

from __future__ import annotations

from firmloop.identify.plants.assembly import Assembly
from firmloop.identify.plants.effect import Effect, EffectParameter, Scales, Site, ceiling, ended


def parameters(site: Site) -> tuple[EffectParameter, ...]:
    """Name the constants."""
    return (
        ceiling(ended("range", site.output_ending), site.output_unit),
        EffectParameter("start", "", -1.0, 0.0, -0.5, False, -0.5),
    )


def starts(site: Site, scales: Scales) -> tuple[tuple[float, ...], ...]:
    """Propose where a fit begins."""
    return ((scales.output_high - scales.output_low, -0.5), (scales.output_high - scales.output_low, 0.0))


def attach(assembly: Assembly, site: Site, values: tuple[float, ...]) -> None:
    """Add it to a simulation."""
    assembly.map_output(site.output, "sensor_wrap", values)


EFFECT = Effect(
    name="sensor_wrap",
    equation="sensor",
    place="sensor",
    term="y modulo range",
    says="the reading wraps around like an overflowing counter",
    parameters=parameters,
    starts=starts,
    confusable_with=("sensor_rectified",),
    experiment="slow motion through the whole range",
    rotary_only=False,
    needs_position=False,
    attach=attach,
    codes=(
        (
            "sensor_wrap",
            """    const double turns = v->y / q[0] - q[1];
    return q[0] * (turns - floor(turns) + q[1]);""",
        ),
    ),
    switches=(0,),
    stage=9,
    seen_by="wraps",
)

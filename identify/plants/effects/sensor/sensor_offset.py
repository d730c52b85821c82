"""A sensor whose zero is off: y + c."""

from __future__ import annotations

from collections.abc import Mapping

from firmloop.identify.plants.assembly import Assembly
from firmloop.identify.plants.effect import Effect, EffectParameter, Scales, Site, ended, signed


def parameters(site: Site) -> tuple[EffectParameter, ...]:
    """Name the constants."""
    return (signed(ended("offset", site.output_ending), site.output_unit),)


def starts(site: Site, scales: Scales) -> tuple[tuple[float, ...], ...]:
    """Propose where a fit begins."""
    return ((0.02 * scales.output,), (-0.02 * scales.output,))


def attach(assembly: Assembly, site: Site, values: tuple[float, ...]) -> None:
    """Add it to a simulation."""
    assembly.map_output(site.output, "sensor_offset", values)


def undo(values: Mapping[str, float], reading: float) -> float:
    """Return what a reading is without it."""
    return reading - next(iter(values.values()))


EFFECT = Effect(
    name="sensor_offset",
    equation="sensor",
    place="sensor",
    term="y + c",
    says="the sensor's zero is off",
    parameters=parameters,
    starts=starts,
    confusable_with=("load_torque",),
    experiment="a recording with no input and the shaft at rest",
    rotary_only=False,
    needs_position=False,
    attach=attach,
    codes=(
        (
            "sensor_offset",
            """    return v->y + q[0];""",
        ),
    ),
    switches=(0,),
    slow=True,
    lasting=True,
    stage=6,
    per_recording="zero",
    undo=undo,
)

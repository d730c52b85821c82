"""An output that is read late: y(t - d), this output alone."""

from __future__ import annotations

from firmloop.identify.plants.assembly import Assembly
from firmloop.identify.plants.effect import Effect, EffectParameter, Scales, Site, size, within


def parameters(site: Site) -> tuple[EffectParameter, ...]:
    """Name the constants."""
    return (size("delay_s", "s"),)


def starts(site: Site, scales: Scales) -> tuple[tuple[float, ...], ...]:
    """Propose where a fit begins."""
    return tuple((time,) for time in scales.times(0.5))


def attach(assembly: Assembly, site: Site, values: tuple[float, ...]) -> None:
    """Add it to a simulation."""
    assembly.timing.output_delay[site.output] = values[0]


EFFECT = Effect(
    name="sensor_delay",
    equation="sensor",
    place="sensor",
    term="y(t - d)",
    says="this output arrives late",
    parameters=parameters,
    starts=starts,
    confusable_with=("sensor_lag", "input_delay", "clock_skew"),
    experiment="fast random steps with a second output to compare",
    rotary_only=False,
    needs_position=False,
    attach=attach,
    codes=(),
    switches=(0,),
    believable=within,
    late=True,
)

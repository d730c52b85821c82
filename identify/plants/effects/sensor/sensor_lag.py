"""A sensor behind a first-order filter."""

from __future__ import annotations

from firmloop.identify.plants.assembly import Assembly
from firmloop.identify.plants.effect import Effect, EffectParameter, Scales, Site, size, within


def parameters(site: Site) -> tuple[EffectParameter, ...]:
    """Name the constants."""
    return (size("time_constant_s", "s"),)


def starts(site: Site, scales: Scales) -> tuple[tuple[float, ...], ...]:
    """Propose where a fit begins."""
    return tuple((time,) for time in scales.times(1.0))


def attach(assembly: Assembly, site: Site, values: tuple[float, ...]) -> None:
    """Add it to a simulation."""
    assembly.lag_output(site.output, values[0])


EFFECT = Effect(
    name="sensor_lag",
    equation="sensor",
    place="sensor",
    term="tau dy/dt = input - y",
    says="the sensor or its filter lags behind",
    parameters=parameters,
    starts=starts,
    confusable_with=("sensor_delay", "input_delay", "slew_rate_limit"),
    experiment="fast random steps",
    rotary_only=False,
    needs_position=False,
    attach=attach,
    believable=within,
    codes=(),
    switches=(0,),
    stage=3,
)

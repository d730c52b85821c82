"""A clock of the outputs that runs at another rate: reading k is taken at t0 + (1 + ratio)(t_k - t0)."""

from __future__ import annotations

from collections.abc import Sequence

from firmloop.identify.plants.assembly import Assembly
from firmloop.identify.plants.effect import Effect, EffectParameter, Scales, Site


def parameters(site: Site) -> tuple[EffectParameter, ...]:
    """Name the constants."""
    return (EffectParameter("ratio", "", -0.1, 0.1, 0.0, False, None),)


def starts(site: Site, scales: Scales) -> tuple[tuple[float, ...], ...]:
    """Propose where a fit begins."""
    return tuple((sign * share,) for sign in (1.0, -1.0) for share in (1e-3, 5e-3, 2e-2))


def believable(values: Sequence[float], scales: Scales) -> bool:
    """Tell whether a clock may be off as much: an RC oscillator without a crystal is by some per cent."""
    return abs(values[0]) < 0.03


def attach(assembly: Assembly, site: Site, values: tuple[float, ...]) -> None:
    """Add it to a simulation."""
    assembly.timing.stretch = values[0]


EFFECT = Effect(
    name="clock_skew",
    equation="timing",
    place="timing",
    term="y(t0 + (1 + ratio) (t - t0))",
    says="the outputs were recorded by a clock that runs at another rate",
    parameters=parameters,
    starts=starts,
    confusable_with=("sensor_delay", "input_delay"),
    experiment="a long recording with sharp edges at its beginning and end",
    rotary_only=False,
    needs_position=False,
    attach=attach,
    codes=(),
    switches=(0,),
    unmet="it is the recorder's clock, not the controller's",
    coordinate="time",
    believable=believable,
    late=True,
)

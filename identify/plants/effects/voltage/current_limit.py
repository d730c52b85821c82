"""A driver that limits its current: it takes back its voltage as soon as the current is at the limit."""

from __future__ import annotations

from firmloop.identify.plants.assembly import Assembly
from firmloop.identify.plants.effect import Effect, EffectParameter, Scales, Site, ceiling


def parameters(site: Site) -> tuple[EffectParameter, ...]:
    """Name the constants."""
    return (ceiling("current_A", "A"),)


def starts(site: Site, scales: Scales) -> tuple[tuple[float, ...], ...]:
    """Propose where a fit begins."""
    return tuple((share * scales.current,) for share in (0.9, 0.6, 0.35))


def attach(assembly: Assembly, site: Site, values: tuple[float, ...]) -> None:
    """Add it to a simulation."""
    assembly.add_limits(site.balance, values[0])


EFFECT = Effect(
    name="current_limit",
    equation="voltage",
    place="voltage",
    term="|i| <= limit",
    says="the driver lets no more current through than a limit",
    parameters=parameters,
    starts=starts,
    confusable_with=("torque_constant_saturation", "input_saturation", "slew_rate_limit"),
    experiment="steps from rest, below and above the voltage that drives the suspected limit through the resistance",
    rotary_only=False,
    needs_position=False,
    attach=attach,
    codes=(),
    switches=(0,),
    unmet="no more current comes than the driver gives; a reference that asks for less torque stays below",
    coordinate="large current",
    limits=True,
)

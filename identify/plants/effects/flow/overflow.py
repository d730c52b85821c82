"""A vessel that runs over: its level stays at a limit, and a share of the excess runs on."""

from __future__ import annotations

from firmloop.identify.plants.assembly import Assembly
from firmloop.identify.plants.effect import Effect, EffectParameter, Scales, Site, ceiling


def parameters(site: Site) -> tuple[EffectParameter, ...]:
    """Name the constants."""
    return (ceiling("level", site.level_unit), EffectParameter("fraction", "", 0.0, 1.0, 0.0, False, 0.0))


def starts(site: Site, scales: Scales) -> tuple[tuple[float, ...], ...]:
    """Propose where a fit begins."""
    return tuple((share * scales.level, 0.3) for share in (0.95, 0.8, 0.65, 0.5))


def possible(site: Site, scales: Scales) -> bool:
    """Tell whether the state may be a level: heat does not run over a rim."""
    return site.level_unit not in ("K", "degC")


def attach(assembly: Assembly, site: Site, values: tuple[float, ...]) -> None:
    """Add it to a simulation."""
    assembly.add_limit(site.balance, values[0], values[1])


EFFECT = Effect(
    name="overflow",
    equation="flow",
    place="flow",
    term="level <= limit, fraction of the excess into the next",
    says="the vessel runs over, and part of what is lost reaches the next one",
    parameters=parameters,
    starts=starts,
    confusable_with=("sensor_saturation",),
    experiment="fill slowly up to the rim and beyond",
    rotary_only=False,
    needs_position=False,
    attach=attach,
    codes=(),
    switches=(0,),
    possible=possible,
    unmet="what runs over is lost; the reference must stay below",
    coordinate="level",
    limits=True,
)

"""A supply with a resistance of its own: u - Rs i."""

from __future__ import annotations

from firmloop.identify.plants.assembly import Assembly
from firmloop.identify.plants.effect import Effect, EffectParameter, Scales, Site, size


def parameters(site: Site) -> tuple[EffectParameter, ...]:
    """Name the constants."""
    return (size("source_ohm", "ohm"),)


def starts(site: Site, scales: Scales) -> tuple[tuple[float, ...], ...]:
    """Propose where a fit begins."""
    return ((0.1 * scales.resistance,), (0.3 * scales.resistance,))


def attach(assembly: Assembly, site: Site, values: tuple[float, ...]) -> None:
    """Add it to a simulation."""
    per, row = assembly.per[site.balance], assembly.row[site.balance]
    assembly.a[row] -= per * values[0] * assembly.current_x
    assembly.b[row] -= per * values[0] * assembly.current_u


EFFECT = Effect(
    name="supply_sag",
    equation="actuator",
    place="voltage",
    term="u - Rs i",
    says="the supply gives way under current",
    parameters=parameters,
    starts=starts,
    confusable_with=("resistance_heating", "input_saturation"),
    experiment="the supply voltage recorded beside the command, or a winding resistance measured by itself",
    rotary_only=False,
    needs_position=False,
    attach=attach,
    codes=(),
    switches=(0,),
    unmet="it lowers the gain at large currents; the integral meets it",
    coordinate="current",
)

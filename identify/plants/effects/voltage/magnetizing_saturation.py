"""A magnetizing inductance that falls with the flux of the air gap: M / (1 + (psi/(M isat))^2)."""

from __future__ import annotations

from firmloop.identify.plants.assembly import Assembly
from firmloop.identify.plants.effect import Effect, EffectParameter, Scales, Site, ceiling


def parameters(site: Site) -> tuple[EffectParameter, ...]:
    """Name the constants: isat is the magnetizing current that M alone would take where M has fallen by half."""
    return (ceiling("current_A", "A"),)


def starts(site: Site, scales: Scales) -> tuple[tuple[float, ...], ...]:
    """Propose where a fit begins."""
    return ((1.0 * scales.current,), (3.0 * scales.current,))


def attach(assembly: Assembly, site: Site, values: tuple[float, ...]) -> None:
    """Add nothing: the equations of the plant hold it, because every current follows from the flux."""


EFFECT = Effect(
    name="magnetizing_saturation",
    equation="voltage",
    place="magnetizing",
    term="M / (1 + (psi/(M isat))^2)",
    says="the iron around the air gap saturates: the motor takes more magnetizing current than its flux should need",
    parameters=parameters,
    starts=starts,
    confusable_with=("resistance_heating", "input_saturation", "quadratic_drag"),
    experiment="running without a load at two voltages: the current grows faster than the voltage",
    rotary_only=False,
    needs_position=False,
    attach=attach,
    codes=(),
    switches=(0,),
    unmet="it is inside the motor and lowers the torque at full voltage; the integral meets it",
)

"""The voltage that the dead time of an inverter takes from each phase: -V sign(i)."""

from __future__ import annotations

from firmloop.identify.plants.assembly import Assembly
from firmloop.identify.plants.effect import Effect, EffectParameter, Scales, Site, size


def parameters(site: Site) -> tuple[EffectParameter, ...]:
    """Name the constants: V is the supply times the dead time over the period of the pulses."""
    return (size("voltage_V", "V"),)


def starts(site: Site, scales: Scales) -> tuple[tuple[float, ...], ...]:
    """Propose where a fit begins."""
    drop = scales.resistance * scales.current  # V: a drive may be told duties
    return ((0.03 * drop,), (0.1 * drop,))


def attach(assembly: Assembly, site: Site, values: tuple[float, ...]) -> None:
    """Add nothing: the equations of the plant hold it, because it acts on phases and they are in the rotor's frame."""


EFFECT = Effect(
    name="dead_time",
    equation="voltage",
    place="bridge",
    term="-V sign(i) in each phase",
    says="the inverter waits between its switches, which takes a voltage against the current from each phase",
    parameters=parameters,
    starts=starts,
    confusable_with=("coulomb_friction", "dead_zone"),
    experiment="small currents at standstill: the voltage they take is more than R i, by the same amount",
    rotary_only=False,
    needs_position=False,
    attach=attach,
    codes=(),
    switches=(0,),
    unmet="it acts on phases; the integrals of a current loop meet its mean",
    coordinate="sign of each phase current",
)

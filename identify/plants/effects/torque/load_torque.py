"""A constant load: -T in either direction, also at rest."""

from __future__ import annotations

from firmloop.identify.plants.assembly import Assembly
from firmloop.identify.plants.effect import Effect, EffectParameter, Holding, Scales, Site, signed


def parameters(site: Site) -> tuple[EffectParameter, ...]:
    """Name the constants."""
    return (signed("torque_N_m" if site.rotary else "force_N", site.force),)


def starts(site: Site, scales: Scales) -> tuple[tuple[float, ...], ...]:
    """Propose where a fit begins."""
    return ((0.1 * scales.effort,), (-0.1 * scales.effort,))


def attach(assembly: Assembly, site: Site, values: tuple[float, ...]) -> None:
    """Add it to a simulation."""
    assembly.c[assembly.speed] -= assembly.per[site.balance] * values[0]


def holding(site: Site, values: tuple[float, ...]) -> Holding:
    """Return what meets it."""
    return Holding(constant=values[0])


EFFECT = Effect(
    name="load_torque",
    equation="torque",
    place="torque",
    term="-T",
    says="a constant load pulls on the shaft in one direction",
    parameters=parameters,
    starts=starts,
    confusable_with=("coulomb_friction", "asymmetric_friction", "gravity_torque", "sensor_offset"),
    experiment="both directions, and the shaft held at rest",
    rotary_only=False,
    needs_position=False,
    attach=attach,
    codes=(),
    switches=(0,),
    holding=holding,
    coordinate="none: constant",
    slow=True,
    lasting=True,
    regime="reversal",
    per_recording="load",
    anywhere=True,
)

"""Friction in proportion to the transmitted torque, -mu |T| sign(w); it sticks at rest."""

from __future__ import annotations

from firmloop.identify.plants.assembly import Assembly
from firmloop.identify.plants.effect import Effect, EffectParameter, Holding, Scales, Site


def parameters(site: Site) -> tuple[EffectParameter, ...]:
    """Name the constants."""
    return (EffectParameter("ratio", "", 0.0, 1.0, 0.0, False, None),)


def starts(site: Site, scales: Scales) -> tuple[tuple[float, ...], ...]:
    """Propose where a fit begins."""
    return ((0.05,), (0.2,))


def attach(assembly: Assembly, site: Site, values: tuple[float, ...]) -> None:
    """Add it to a simulation."""
    assembly.add_level(site.balance, "load_level", values, assembly.current_settles())


def holding(site: Site, values: tuple[float, ...]) -> Holding:
    """Return what meets it."""
    return Holding(share=values[0])


EFFECT = Effect(
    name="load_dependent_friction",
    equation="torque",
    place="torque",
    term="-mu abs(T) sign(w)",
    says="the friction grows with the load that the gears or the guide transmit",
    parameters=parameters,
    starts=starts,
    confusable_with=("coulomb_friction", "quadratic_drag", "stribeck_friction", "torque_constant_saturation"),
    experiment="the same speed with two loads or two accelerations",
    rotary_only=False,
    needs_position=False,
    attach=attach,
    codes=(
        (
            "load_level",
            """    return q[0] * fabs(v->effort);""",
        ),
    ),
    switches=(0,),
    holding=holding,
    coordinate="load torque and sign of speed",
)

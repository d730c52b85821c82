"""Coulomb friction: a constant torque against the motion, -Tc sign(w), that sticks at rest."""

from __future__ import annotations

from firmloop.identify.plants.assembly import STEADY, Assembly
from firmloop.identify.plants.effect import Effect, EffectParameter, Holding, Scales, Site, size


def parameters(site: Site) -> tuple[EffectParameter, ...]:
    """Name the constants."""
    return (size("torque_N_m" if site.rotary else "force_N", site.force),)


def starts(site: Site, scales: Scales) -> tuple[tuple[float, ...], ...]:
    """Propose where a fit begins."""
    return ((0.05 * scales.effort,), (0.2 * scales.effort,))


def attach(assembly: Assembly, site: Site, values: tuple[float, ...]) -> None:
    """Add it to a simulation."""
    assembly.add_level(site.balance, "coulomb_level", values, STEADY)


def holding(site: Site, values: tuple[float, ...]) -> Holding:
    """Return what meets it."""
    return Holding(up=values[0], down=values[0])


EFFECT = Effect(
    name="coulomb_friction",
    equation="torque",
    place="torque",
    term="-Tc sign(w)",
    says="a dry friction of constant size opposes the motion and holds the shaft at rest",
    parameters=parameters,
    starts=starts,
    confusable_with=(
        "stribeck_friction",
        "asymmetric_friction",
        "load_dependent_friction",
        "presliding_friction",
        "load_torque",
        "dead_zone",
        "brush_drop",
    ),
    experiment="slow motion through zero speed in both directions",
    rotary_only=False,
    needs_position=False,
    attach=attach,
    codes=(
        (
            "coulomb_level",
            """    (void)v;
    return q[0];""",
        ),
    ),
    switches=(0,),
    holding=holding,
    coordinate="sign of speed",
    regime="reversal",
)

"""Drag in proportion to the square of the speed, -c |w| w."""

from __future__ import annotations

from firmloop.identify.plants.assembly import Assembly
from firmloop.identify.plants.effect import Effect, EffectParameter, Holding, Scales, Site, size


def parameters(site: Site) -> tuple[EffectParameter, ...]:
    """Name the constants."""
    return (size("coefficient_N_m_s2_rad2" if site.rotary else "coefficient_N_s2_m2", site.force_per(2, 2)),)


def starts(site: Site, scales: Scales) -> tuple[tuple[float, ...], ...]:
    """Propose where a fit begins."""
    return ((0.1 * scales.effort / scales.speed**2,), (0.4 * scales.effort / scales.speed**2,))


def attach(assembly: Assembly, site: Site, values: tuple[float, ...]) -> None:
    """Add it to a simulation."""
    per = assembly.per[site.balance]
    assembly.add_term(assembly.speed, "quadratic_drag", values, per, (0.0, 2.0 * values[0] * per, 0.0, 0.0, 0.0, 0.0))


def holding(site: Site, values: tuple[float, ...]) -> Holding:
    """Return what meets it."""
    return Holding(drag=values[0])


EFFECT = Effect(
    name="quadratic_drag",
    equation="torque",
    place="torque",
    term="-c abs(w) w",
    says="air or fluid drag grows with the square of the speed",
    parameters=parameters,
    starts=starts,
    confusable_with=("load_dependent_friction", "coulomb_friction"),
    experiment="plateaus of speed up to the fastest",
    rotary_only=False,
    needs_position=False,
    attach=attach,
    codes=(
        (
            "quadratic_drag",
            """    return -q[0] * fabs(v->w) * v->w;""",
        ),
    ),
    switches=(0,),
    holding=holding,
    coordinate="speed squared",
    anywhere=True,
)

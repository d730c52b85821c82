"""Dahl's presliding friction: a spring that yields, dF/dx = sigma (1 - F sign(w) / Tc)."""

from __future__ import annotations

from collections.abc import Sequence

from firmloop.identify.plants.assembly import STEADY, Assembly, ringing
from firmloop.identify.plants.effect import Effect, EffectParameter, Holding, Scales, Site, shape, size

_AT_ONCE, _LATE = 1e-6, 0.5  # of the way


def parameters(site: Site) -> tuple[EffectParameter, ...]:
    """Name the constants."""
    return (
        shape(f"stiffness_{site.stiffness}", site.force_per(1), 1.0),
        size(f"coulomb_{site.effort}", site.force),
    )


def starts(site: Site, scales: Scales) -> tuple[tuple[float, ...], ...]:
    """Propose where a fit begins."""
    return tuple(
        (part * scales.effort / (share * scales.travel), part * scales.effort)
        for part in (0.05, 0.15)
        for share in (0.001, 0.02, 0.1)
    )


def attach(assembly: Assembly, site: Site, values: tuple[float, ...]) -> None:
    """Add it to a simulation."""
    per = assembly.per[site.balance]
    assembly.add_level(site.balance, "presliding_level", (), STEADY)
    rate = 2.0 * ringing(values[0], per)
    assembly.add_term(assembly.speed, "presliding_force", values, per, (rate, 0.0, 0.0, 0.0, 0.0, 0.0))


def holding(site: Site, values: tuple[float, ...]) -> Holding:
    """Return what meets it."""
    return Holding(up=values[1], down=values[1])


def becomes(values: Sequence[float], scales: Scales) -> str:
    """Name what it is where it hardly yields on its way, or does at once."""
    stiffness, coulomb = values
    if coulomb > _LATE * stiffness * scales.travel:
        return "return_spring"
    return "coulomb_friction" if coulomb < _AT_ONCE * stiffness * scales.travel else ""


EFFECT = Effect(
    name="presliding_friction",
    equation="torque",
    place="torque",
    term="-F, dF/dtheta = sigma (1 - F sign(w) / Tc)",
    says="the contact gives way like a spring before it slides",
    parameters=parameters,
    starts=starts,
    confusable_with=("coulomb_friction", "stribeck_friction", "backlash", "flexible_coupling"),
    experiment="a slow torque sine that stays below what makes the shaft slide",
    rotary_only=False,
    needs_position=True,
    attach=attach,
    codes=(
        (
            "presliding_level",
            """    (void)v;
    (void)q;
    return 0.0;""",
        ),
        (
            "presliding_force",
            """    const double level = q[1] * v->s;
    if (v->s == 0.0) {
        return -v->m[0];
    }
    return -(level + (v->m[0] - level) * exp(-q[0] * fabs(v->th - v->m[1]) / q[1]));""",
        ),
    ),
    switches=(1,),
    holding=holding,
    becomes=becomes,
    coordinate="travel since the last reversal",
    contains=("coulomb_friction",),
    remembers="presliding_force",
)

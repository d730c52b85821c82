"""Stribeck friction: falls from a static to a sliding level, -(Tc + (Ts - Tc) exp(-(w/ws)^2)) sign(w)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from firmloop.identify.plants.assembly import Assembly
from firmloop.identify.plants.effect import Effect, EffectParameter, Holding, Scales, Site, shape, size

_LEAST = 0.1  # of the static friction, that is left in motion


def parameters(site: Site) -> tuple[EffectParameter, ...]:
    """Name the constants."""
    return (
        size(f"coulomb_{site.effort}", site.force),
        size(f"static_{site.effort}", site.force),
        shape("stribeck_rad_s" if site.rotary else "stribeck_m_s", site.speed_unit, 1.0),
    )


def starts(site: Site, scales: Scales) -> tuple[tuple[float, ...], ...]:
    """Propose where a fit begins."""
    return tuple(
        (part * scales.effort, 2.0 * part * scales.effort, share * scales.speed)
        for part in (0.05, 0.15)
        for share in (0.01, 0.05)
    )


def attach(assembly: Assembly, site: Site, values: tuple[float, ...]) -> None:
    """Add it to a simulation."""
    coulomb, static, speed = values
    steep = abs(static - coulomb) * assembly.per[site.balance] / speed
    assembly.add_level(site.balance, "stribeck_level", values, (steep, 0.0, 1.0 / speed, 0.0, 0.0, 0.0))


def holding(site: Site, values: tuple[float, ...]) -> Holding:
    """Return what meets it."""
    return Holding(up=values[0], down=values[0], extra=values[1] - values[0], slow=values[2])


def bounded(parameter: EffectParameter, scales: Scales) -> EffectParameter:
    """Keep the speed at which friction falls inside the recorded ones."""
    return replace(parameter, high=scales.speed) if parameter.name.startswith("stribeck_") else parameter


def within(values: Sequence[float], scales: Scales) -> tuple[float, ...]:
    """Return values near these at which friction does not rise with speed: there a fit would leave for a drag."""
    coulomb, static, speed = values
    return max(coulomb, _LEAST * static), max(static, coulomb), speed


def believable(values: Sequence[float], scales: Scales) -> bool:
    """Tell whether friction falls, and not to nothing: what rises is a drag, what vanishes no friction."""
    coulomb, static, _ = values
    return static >= coulomb >= _LEAST * static


EFFECT = Effect(
    name="stribeck_friction",
    equation="torque",
    place="torque",
    term="-(Tc + (Ts - Tc) exp(-(w/ws)^2)) sign(w)",
    says="dry friction is larger at rest than in motion, so that slow motion sticks and slips",
    parameters=parameters,
    starts=starts,
    confusable_with=("coulomb_friction", "presliding_friction", "load_dependent_friction"),
    experiment="creep at a fraction of the speed where the friction falls, with stops",
    rotary_only=False,
    needs_position=False,
    attach=attach,
    codes=(
        (
            "stribeck_level",
            """    const double r = v->w / q[2];
    return q[0] + (q[1] - q[0]) * exp(-r * r);""",
        ),
    ),
    switches=(0, 1),
    holding=holding,
    bounded=bounded,
    within=within,
    believable=believable,
    coordinate="speed near rest",
    contains=("coulomb_friction",),
)

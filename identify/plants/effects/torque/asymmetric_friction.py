"""Friction that differs with the direction: -Tp for w > 0, +Tn for w < 0; it sticks at rest."""

from __future__ import annotations

from collections.abc import Sequence

from firmloop.identify.plants.assembly import STEADY, Assembly
from firmloop.identify.plants.effect import Effect, EffectParameter, Holding, Scales, Site, size

_ALIKE = 0.05  # of both, by which two directions differ that are one


def parameters(site: Site) -> tuple[EffectParameter, ...]:
    """Name the constants."""
    return (size(f"positive_{site.effort}", site.force), size(f"negative_{site.effort}", site.force))


def starts(site: Site, scales: Scales) -> tuple[tuple[float, ...], ...]:
    """Propose where a fit begins."""
    return ((0.05 * scales.effort, 0.1 * scales.effort), (0.1 * scales.effort, 0.05 * scales.effort))


def attach(assembly: Assembly, site: Site, values: tuple[float, ...]) -> None:
    """Add it to a simulation."""
    assembly.add_level(site.balance, "asymmetric_level", values, STEADY)


def holding(site: Site, values: tuple[float, ...]) -> Holding:
    """Return what meets it."""
    return Holding(up=values[0], down=values[1])


def becomes(values: Sequence[float], scales: Scales) -> str:
    """Name what it is where both directions are alike."""
    positive, negative = values
    return "coulomb_friction" if abs(positive - negative) < _ALIKE * (positive + negative) / 2.0 else ""


EFFECT = Effect(
    name="asymmetric_friction",
    equation="torque",
    place="torque",
    term="-Tp for w > 0, +Tn for w < 0",
    says="dry friction is larger in one direction than in the other",
    parameters=parameters,
    starts=starts,
    confusable_with=("coulomb_friction", "load_torque"),
    experiment="the same slow motion in both directions, and the shaft let go at rest",
    rotary_only=False,
    needs_position=False,
    attach=attach,
    codes=(
        (
            "asymmetric_level",
            """    return v->s > 0.0 ? q[0] : q[1];""",
        ),
    ),
    switches=(0, 1),
    sum_of=(("coulomb_friction", (1.0, 1.0)), ("load_torque", (1.0, -1.0))),
    holding=holding,
    becomes=becomes,
    coordinate="sign of speed",
    contains=("coulomb_friction",),
    regime="reversal",
)

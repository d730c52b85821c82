"""A weight on an arm or an unbalance: -T sin(theta + phi)."""

from __future__ import annotations

import math

from firmloop.identify.plants.assembly import Assembly, ringing
from firmloop.identify.plants.effect import Effect, EffectParameter, Holding, Scales, Site, phase, size


def parameters(site: Site) -> tuple[EffectParameter, ...]:
    """Name the constants."""
    return (size("amplitude_N_m", site.force), phase("phase_rad"))


def starts(site: Site, scales: Scales) -> tuple[tuple[float, ...], ...]:
    """Propose where a fit begins."""
    return tuple((0.1 * scales.effort, 0.5 * math.pi * k) for k in range(4))


def attach(assembly: Assembly, site: Site, values: tuple[float, ...]) -> None:
    """Add it to a simulation."""
    per = assembly.per[site.balance]
    assembly.add_term(assembly.speed, "gravity", values, per, (ringing(values[0], per), 1.0, 0.0, 0.0, 0.0, 0.0))


def holding(site: Site, values: tuple[float, ...]) -> Holding:
    """Return what meets it."""
    return Holding(wave=values[0], phase=values[1])


EFFECT = Effect(
    name="gravity_torque",
    equation="torque",
    place="torque",
    term="-T sin(theta + phi)",
    says="gravity pulls on an arm or an unbalanced rotor",
    parameters=parameters,
    starts=starts,
    confusable_with=("load_torque", "return_spring", "cogging_torque", "eccentric_encoder"),
    experiment="slow full turns in both directions",
    rotary_only=True,
    needs_position=True,
    attach=attach,
    codes=(
        (
            "gravity",
            """    return -q[0] * sine(v, angle(v, 1.0) + q[1]);""",
        ),
    ),
    switches=(0,),
    holding=holding,
    coordinate="position, once per turn",
    slow=True,
    seen_by="turn",
)

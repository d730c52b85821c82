"""Ripple of the torque in proportion to it: -r T sin(n theta + phi), T = kt i."""

from __future__ import annotations

import math

from firmloop.identify.plants.assembly import Assembly
from firmloop.identify.plants.effect import Effect, EffectParameter, Scales, Site, phase, shape


def parameters(site: Site) -> tuple[EffectParameter, ...]:
    """Name the constants."""
    return (
        EffectParameter("ratio", "", 0.0, 1.0, 0.0, False, None),
        shape("periods_per_rev" if site.rotary else "periods_per_m", "" if site.rotary else "1/m", 1.0),
        phase("phase_rad"),
    )


def starts(site: Site, scales: Scales) -> tuple[tuple[float, ...], ...]:
    """Propose where a fit begins."""
    return tuple(
        (0.1, n if site.rotary else n / scales.travel, 0.5 * math.pi * k)
        for n in (2.0, 4.0, 6.0, 7.0, 8.0, 12.0, 14.0, 24.0, 36.0)
        for k in range(4)
    )


def attach(assembly: Assembly, site: Site, values: tuple[float, ...]) -> None:
    """Add it to a simulation."""
    per = assembly.per[site.balance]
    turns = values[1] if site.rotary else 2.0 * math.pi * values[1]
    constants = (values[0], turns, values[2])
    slow, _, _, _, _, quick = assembly.current_settles()
    assembly.add_term(assembly.speed, "ripple", constants, per, (slow, turns, 0.0, 0.0, 0.0, quick))


EFFECT = Effect(
    name="torque_ripple",
    equation="torque",
    place="torque",
    term="-r kt i sin(n theta + phi)",
    says="the torque of the drive varies with the angle",
    parameters=parameters,
    starts=starts,
    confusable_with=("cogging_torque", "gravity_torque"),
    experiment="slow constant speed at two currents",
    rotary_only=False,
    needs_position=True,
    attach=attach,
    codes=(
        (
            "ripple",
            """    return -q[0] * v->effort * sine(v, q[1] * angle(v, q[1]) + q[2]);""",
        ),
    ),
    switches=(0,),
    unmet="it scales the torque, which the controller does not command",
    coordinate="position, several times per turn, and current",
    seen_by="order of effort",
)

"""Cogging: magnets and slots pull the rotor to preferred angles, -T sin(n theta + phi)."""

from __future__ import annotations

import math

from firmloop.identify.plants.assembly import Assembly, ringing
from firmloop.identify.plants.effect import Effect, EffectParameter, Holding, Scales, Site, phase, shape, size

_FEWEST = 1.5  # periods per turn


def parameters(site: Site) -> tuple[EffectParameter, ...]:
    """Name the constants; once per turn is gravity's."""
    periods = EffectParameter("periods_per_rev", "", _FEWEST, math.inf, 1.0, True, None)
    return (
        size(f"amplitude_{site.effort}", site.force),
        periods if site.rotary else shape("periods_per_m", "1/m", 1.0),
        phase("phase_rad"),
    )


def starts(site: Site, scales: Scales) -> tuple[tuple[float, ...], ...]:
    """Propose where a fit begins."""
    return tuple(
        (0.05 * scales.effort, n if site.rotary else n / scales.travel, 0.5 * math.pi * k)
        for n in (2.0, 4.0, 6.0, 7.0, 8.0, 12.0, 14.0, 24.0, 36.0)
        for k in range(4)
    )


def attach(assembly: Assembly, site: Site, values: tuple[float, ...]) -> None:
    """Add it to a simulation."""
    per = assembly.per[site.balance]
    turns = values[1] if site.rotary else 2.0 * math.pi * values[1]
    rate = ringing(turns * values[0], per)
    constants = (values[0], turns, values[2])
    assembly.add_term(assembly.speed, "cogging", constants, per, (rate, turns, 0.0, 0.0, 0.0, 0.0))


def holding(site: Site, values: tuple[float, ...]) -> Holding:
    """Return what meets it."""
    return Holding(wave=values[0], turns=values[1] * (1.0 if site.rotary else 2.0 * math.pi), phase=values[2])


EFFECT = Effect(
    name="cogging_torque",
    equation="torque",
    place="torque",
    term="-T sin(n theta + phi)",
    says="the rotor is pulled to preferred angles, whatever the current",
    parameters=parameters,
    starts=starts,
    confusable_with=("torque_ripple", "gravity_torque", "sensor_quantization"),
    experiment="slow constant speed at two currents",
    rotary_only=False,
    needs_position=True,
    attach=attach,
    codes=(
        (
            "cogging",
            """    return -q[0] * sine(v, q[1] * angle(v, q[1]) + q[2]);""",
        ),
    ),
    switches=(0,),
    holding=holding,
    coordinate="position, several times per turn",
    seen_by="order",
)

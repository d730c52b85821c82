"""A second inertia over a spring and a damper: resonance and antiresonance."""

from __future__ import annotations

import math
from collections.abc import Sequence

from firmloop.identify.plants.assembly import Assembly
from firmloop.identify.plants.effect import Effect, EffectParameter, Scales, Site, damping, shape, size

_STILL = 0.05  # of a twist, that the second inertia turns by in a whole recording: it may as well be held


def parameters(site: Site) -> tuple[EffectParameter, ...]:
    """Name the constants."""
    return (
        shape(f"stiffness_{site.stiffness}", site.force_per(1), 1.0),
        size(site.load, site.load_unit),
        damping(site),
    )


def starts(site: Site, scales: Scales) -> tuple[tuple[float, ...], ...]:
    """Propose where a fit begins."""
    return tuple(
        (
            share * scales.inertia * (2.0 * math.pi / period) ** 2,
            share * scales.inertia,
            0.1 * share * scales.inertia * 2.0 * math.pi / period,
        )
        for share in (0.3, 1.0)
        for period in scales.times(8.0)
    )


def attach(assembly: Assembly, site: Site, values: tuple[float, ...]) -> None:
    """Add it to a simulation."""
    stiffness, inertia, damping = values
    per, motor = assembly.per[site.balance], assembly.speed
    load = assembly.add_state(lambda x: float(x[motor]))
    twist = assembly.add_state(lambda x: 0.0)
    for row, share in ((motor, -per), (load, 1.0 / inertia)):
        assembly.a[row, twist] += share * stiffness
        assembly.a[row, motor] += share * damping
        assembly.a[row, load] -= share * damping
    assembly.a[twist, motor] += 1.0
    assembly.a[twist, load] -= 1.0


def becomes(values: Sequence[float], scales: Scales) -> str:
    """Name a spring to where it began where the second inertia is too large to follow."""
    stiffness, inertia, _damping = values
    return "return_spring" if 0.5 * stiffness * scales.span**2 < _STILL * inertia else ""


def believable(values: Sequence[float], scales: Scales) -> bool:
    """Tell whether the second inertia swings on its spring for a row at least: a stiffer one moves with the first."""
    stiffness, inertia, _damping = values
    return stiffness * scales.step**2 < (2.0 * math.pi) ** 2 * inertia


EFFECT = Effect(
    name="flexible_coupling",
    equation="torque",
    place="torque",
    term="-k (theta - thetaL) - d (w - wL); JL dwL/dt = the same",
    says="a second inertia hangs on a flexible coupling",
    parameters=parameters,
    starts=starts,
    confusable_with=("backlash", "return_spring", "input_delay", "sensor_lag", "presliding_friction"),
    experiment="a chirp across the resonance at two amplitudes",
    rotary_only=False,
    needs_position=False,
    attach=attach,
    codes=(),
    switches=(1,),
    believable=believable,
    becomes=becomes,
    unmet="the second body moves by itself; an observer or a notch meets that",
    coordinate="frequency",
)

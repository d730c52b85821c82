"""A second inertia over a gap of total width g, with elastic, damped flanks."""

from __future__ import annotations

import math
from collections.abc import Sequence

from firmloop.identify.plants.assembly import Assembly, ringing
from firmloop.identify.plants.effect import Effect, EffectParameter, Scales, Site, damping, shape, size

_TONE = 2.0 * math.pi * 100.0  # rad/s; how hard the flanks are where nothing is said


def _flanks(reduced: float, tone: float) -> tuple[float, float]:
    """Stiffness and damping of flanks on which a reduced inertia rings at `tone` rad/s, three tenths damped."""
    return reduced * tone**2, 0.6 * reduced * tone


def parameters(site: Site) -> tuple[EffectParameter, ...]:
    """Name the constants."""
    return (
        shape(f"gap_{site.travel}", site.travel_unit, 1.0),
        size(site.load, site.load_unit),
        EffectParameter(f"stiffness_{site.stiffness}", site.force_per(1), 0.0, math.inf, 0.0, True, 0.0),
        damping(site),
    )


def starts(site: Site, scales: Scales) -> tuple[tuple[float, ...], ...]:
    """Propose where a fit begins."""
    widest = 0.2 if site.rotary else math.inf  # rad: gears have no more, however far they turn
    grid = [
        (
            min(gap * scales.travel, min(100.0 * gap, 1.0) * widest),
            share * scales.inertia,
            *_flanks(share * scales.inertia / (1.0 + share), tone),
        )
        for gap, shares in ((1e-4, (1.0,)), (1e-3, (0.3, 1.0)), (3e-3, (0.3, 1.0)), (1e-2, (0.3, 1.0)), (3e-2, (0.3,)))
        for share in shares
        for tone in (2.0 * math.pi * 0.03 / scales.step, 2.0 * math.pi * 0.1 / scales.step)
    ]
    return tuple(dict.fromkeys(grid))


def attach(assembly: Assembly, site: Site, values: tuple[float, ...]) -> None:
    """Add it to a simulation."""
    gap, inertia, stiffness, damping = values
    per, motor = assembly.per[site.balance], assembly.speed
    if stiffness == 0.0:
        stiffness, damping = _flanks(inertia / (1.0 + inertia * per), _TONE)
    load = assembly.add_state(lambda x: float(x[motor]))
    twist = assembly.add_state(lambda x: 0.0)
    constants = (0.5 * gap, stiffness, damping, float(load), float(twist))
    rate = 6.0 * ringing(stiffness, per + 1.0 / inertia)
    slopes = ((twist, stiffness), (motor, damping), (load, -damping))
    assembly.add_flank(motor, "backlash", constants, -per, rate, *slopes)
    assembly.add_flank(load, "backlash", constants, 1.0 / inertia, rate, *slopes)
    assembly.a[twist, motor] += 1.0
    assembly.a[twist, load] -= 1.0


def believable(values: Sequence[float], scales: Scales) -> bool:
    """Tell whether the flanks push at all: bodies between softer ones would not ring once in a whole recording."""
    _gap, inertia, stiffness, _damping = values
    reduced = inertia * scales.inertia / (inertia + scales.inertia)
    return stiffness == 0.0 or stiffness * scales.span**2 > reduced * (2.0 * math.pi) ** 2


EFFECT = Effect(
    name="backlash",
    equation="torque",
    place="torque",
    term="-F(theta - thetaL), zero within +-g/2; JL dwL/dt = F",
    says="play in the gears: the load follows only after a gap has closed",
    parameters=parameters,
    starts=starts,
    confusable_with=("flexible_coupling", "presliding_friction", "dead_zone"),
    experiment="reversals at several amplitudes",
    rotary_only=False,
    needs_position=False,
    attach=attach,
    codes=(
        (
            "backlash",
            """    const double twist = v->x[(int)q[4]];
    const double pressed = fabs(twist) - q[0], side = copysign(1.0, twist);
    const double push = q[1] * pressed + q[2] * side * (v->w - v->x[(int)q[3]]);
    return pressed > 0.0 && push > 0.0 ? side * push : 0.0;""",
        ),
    ),
    switches=(1,),
    believable=believable,
    unmet="which flank bears cannot be seen from the reference",
    coordinate="reversals",
    contains=("flexible_coupling",),
    contact=("gap", "stiffness", "damping"),
    touches=True,
)

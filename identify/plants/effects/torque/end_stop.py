"""A stop that never pulls: -k (theta - theta0) - c w beyond theta0, above it where theta0 >= 0, below it where not."""

from __future__ import annotations

import math
from collections.abc import Sequence

from firmloop.identify.plants.assembly import Assembly, ringing
from firmloop.identify.plants.effect import Effect, EffectParameter, Scales, Site, damping, signed, size

_BEFORE, _DEEP = 0.05, 0.3  # of the whole way, or of the way to that side: where a stop may be before its end
_LOSS = 0.6  # twice the share of critical damping
_EARLIEST = 0.1  # of the way to that side: no stop comes before


def parameters(site: Site) -> tuple[EffectParameter, ...]:
    """Name the constants."""
    return (
        signed(f"position_{site.travel}", site.travel_unit),
        size(f"stiffness_{site.stiffness}", site.force_per(1)),
        damping(site),
    )


def starts(site: Site, scales: Scales) -> tuple[tuple[float, ...], ...]:
    """Propose where a fit begins: somewhat before either end of the way, on that side of zero, lossy and not."""
    high = scales.place_high - min(_BEFORE * scales.travel, _DEEP * abs(scales.place_high))
    low = scales.place_low + min(_BEFORE * scales.travel, _DEEP * abs(scales.place_low))
    return tuple((place, *contact) for contact in contacts(scales) for place in (high, low))


def contacts(scales: Scales) -> tuple[tuple[float, float], ...]:
    """Propose how stiff and how damped a stop is, lossy and not."""
    return tuple(
        (stiffness, loss * math.sqrt(stiffness * scales.inertia))
        for stiffness in (10.0 * scales.effort / scales.travel, 200.0 * scales.effort / scales.travel)
        for loss in (0.0, _LOSS)
    )


def press(assembly: Assembly, site: Site, code: str, values: tuple[float, ...]) -> None:
    """Add what the stops of a code do; the last of their values are how stiff and how damped they are."""
    *_, stiffness, loss = values
    per = assembly.per[site.balance]
    slopes = ((assembly.position, -stiffness), (assembly.speed, -loss))
    assembly.add_flank(assembly.speed, code, values, per, 4.0 * ringing(stiffness, per), *slopes)


def attach(assembly: Assembly, site: Site, values: tuple[float, ...]) -> None:
    """Add it to a simulation."""
    press(assembly, site, "end_stop", values)


def believable(values: Sequence[float], scales: Scales) -> bool:
    """Tell whether the way goes up to the stop: what acts all the way is a spring."""
    reach = scales.place_high if values[0] >= 0.0 else scales.place_low
    return abs(values[0]) >= _EARLIEST * abs(reach)


EFFECT = Effect(
    name="end_stop",
    equation="torque",
    place="torque",
    term="-k (theta - theta0) - c w beyond theta0",
    says="the travel ends at an elastic stop",
    parameters=parameters,
    starts=starts,
    confusable_with=("return_spring", "hardening_spring"),
    experiment="approach both ends of the travel at two speeds",
    rotary_only=False,
    needs_position=True,
    attach=attach,
    codes=(
        (
            "end_stop",
            """    const double side = q[0] >= 0.0 ? 1.0 : -1.0, pressed = side * (v->th - q[0]);
    const double push = q[1] * pressed + q[2] * side * v->w;
    return pressed > 0.0 && push > 0.0 ? -side * push : 0.0;""",
        ),
    ),
    switches=(1,),
    unmet="a reference must stay off the stop, not press against it",
    believable=believable,
    coordinate="position",
    slow=True,
    limits=True,
    touches=True,
)

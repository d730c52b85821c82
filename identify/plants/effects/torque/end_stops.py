"""Two stops, alike, at the ends of the way: each -k (theta - theta0) - c w beyond its theta0; neither pulls."""

from __future__ import annotations

from collections.abc import Sequence

from firmloop.identify.plants.assembly import Assembly
from firmloop.identify.plants.effect import Effect, EffectParameter, Scales, Site, damping, signed, size
from firmloop.identify.plants.effects.torque.end_stop import contacts, press

_BEFORE = 0.05  # of the whole way: where a stop may be before its end
_EARLIEST = 0.1  # of the whole way: no stops are nearer to one another


def parameters(site: Site) -> tuple[EffectParameter, ...]:
    """Name the constants."""
    return (
        signed(f"low_{site.travel}", site.travel_unit),
        signed(f"high_{site.travel}", site.travel_unit),
        size(f"stiffness_{site.stiffness}", site.force_per(1)),
        damping(site),
    )


def starts(site: Site, scales: Scales) -> tuple[tuple[float, ...], ...]:
    """Propose where a fit begins: somewhat before both ends of the way, lossy and not."""
    before = _BEFORE * (scales.place_high - scales.place_low)
    ends = (scales.place_low + before, scales.place_high - before)
    return tuple((*ends, *contact) for contact in contacts(scales))


def attach(assembly: Assembly, site: Site, values: tuple[float, ...]) -> None:
    """Add it to a simulation."""
    press(assembly, site, "end_stops", values)


def becomes(values: Sequence[float], scales: Scales) -> str:
    """Name the one stop that is left where the way does not go up to the other."""
    return "end_stop" if values[0] <= scales.place_low or values[1] >= scales.place_high else ""


def believable(values: Sequence[float], scales: Scales) -> bool:
    """Tell whether the way goes on between the stops: what acts all the way is a spring."""
    return values[1] - values[0] >= _EARLIEST * (scales.place_high - scales.place_low)


EFFECT = Effect(
    name="end_stops",
    equation="torque",
    place="torque",
    term="-k (theta - theta0) - c w beyond either theta0",
    says="the travel ends at elastic stops on both sides",
    parameters=parameters,
    starts=starts,
    confusable_with=("hardening_spring", "end_stop", "sensor_saturation"),
    experiment="approach both ends of the travel at two speeds",
    rotary_only=False,
    needs_position=True,
    attach=attach,
    codes=(
        (
            "end_stops",
            """    const double side = v->th > q[1] ? 1.0 : -1.0;
    const double pressed = side > 0.0 ? v->th - q[1] : q[0] - v->th, push = q[2] * pressed + q[3] * side * v->w;
    return pressed > 0.0 && push > 0.0 ? -side * push : 0.0;""",
        ),
    ),
    switches=(2,),
    unmet="a reference must stay off the stop, not press against it",
    believable=believable,
    becomes=becomes,
    contains=("end_stop",),
    coordinate="position",
    slow=True,
    limits=True,
    touches=True,
)

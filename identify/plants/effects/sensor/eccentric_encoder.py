"""An encoder off its centre: the angle y + e sin(theta + phi); its speed reads the derivative of that."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

from firmloop.identify.plants.assembly import Assembly
from firmloop.identify.plants.effect import Effect, EffectParameter, Scales, Site, phase, size

_MOST = 0.2  # rad: eccentricity over the radius of the track
_TURNS = 20
_TRUE_ANGLE = """    double angle = v->turn;
    for (int k = 0; k < 4 && v->turn != v->th; ++k) {
        angle = v->turn - q[0] * sine(v, angle + q[1]); /* a recorded angle has the error in it */
    }
"""


def parameters(site: Site) -> tuple[EffectParameter, ...]:
    """Name the constants."""
    return (replace(size("amplitude_rad", "rad"), high=_MOST), phase("phase_rad"))


def starts(site: Site, scales: Scales) -> tuple[tuple[float, ...], ...]:
    """Propose where a fit begins."""
    return tuple((0.005, 0.5 * math.pi * k) for k in range(4))


def attach(assembly: Assembly, site: Site, values: tuple[float, ...]) -> None:
    """Add it to a simulation."""
    code = "eccentric_speed" if site.output_unit == "rad/s" else "eccentric_angle"
    assembly.map_output(site.output, code, values)


def undo(values: Mapping[str, float], reading: float) -> float:
    """Return the angle that is read so: each turn of the iteration leaves a fifth of the error at most."""
    angle = reading
    for _ in range(_TURNS):
        angle = reading - values["amplitude_rad"] * math.sin(angle + values["phase_rad"])
    return angle


EFFECT = Effect(
    name="eccentric_encoder",
    equation="sensor",
    place="sensor",
    term="y + e sin(theta + phi)",
    says="the encoder disc runs out of true",
    parameters=parameters,
    starts=starts,
    confusable_with=("gravity_torque", "cogging_torque"),
    experiment="two constant speeds a decade apart: the error grows with the speed",
    rotary_only=True,
    needs_position=True,
    attach=attach,
    codes=(
        (
            "eccentric_angle",
            _TRUE_ANGLE + "    return v->y + q[0] * sine(v, angle + q[1]);",
        ),
        (
            "eccentric_speed",
            _TRUE_ANGLE + "    return v->y + q[0] * cos(angle + q[1]) * v->w;",
        ),
    ),
    switches=(0,),
    coordinate="position, once per turn",
    stage=4,
    units=("rad", "rad/s"),
    straight=True,
    undo=undo,
)

"""An encoder off its centre under a drive: its axes are ahead of the magnets by p e sin(theta + phi), electrical."""

from __future__ import annotations

import math
from dataclasses import replace

from firmloop.identify.plants.assembly import Assembly
from firmloop.identify.plants.effect import Effect, EffectParameter, Scales, Site, phase, size
from firmloop.identify.plants.effects.axes.angle_offset import turn_axes

_MOST = 0.2  # rad: eccentricity over the radius of the track


def parameters(site: Site) -> tuple[EffectParameter, ...]:
    """Name the constants, of the shaft."""
    return (replace(size("amplitude_rad", "rad"), high=_MOST), phase("phase_rad"))


def starts(site: Site, scales: Scales) -> tuple[tuple[float, ...], ...]:
    """Propose where a fit begins."""
    return tuple((0.02, 0.5 * math.pi * k) for k in range(4))


def attach(assembly: Assembly, site: Site, values: tuple[float, ...]) -> None:
    """Add it to a simulation."""
    turn_axes(assembly, 0.0, assembly.value("pole_pairs") * values[0], values[1])


EFFECT = Effect(
    name="angle_eccentricity",
    equation="sensor",
    place="axes",
    term="v e^(j eps) at the winding, i e^(-j eps) in the log, eps = p e sin(theta + phi)",
    says="the drive's encoder runs out of true: its axes rock about the magnets once per turn",
    parameters=parameters,
    starts=starts,
    confusable_with=("angle_offset", "eccentric_encoder", "cogging_torque"),
    experiment="a slow turn with a constant current: the torque varies once per turn",
    rotary_only=True,
    needs_position=True,
    attach=attach,
    codes=(),
    switches=(0,),
    unmet="it turns torque into field and back; centre the disc",
    coordinate="position, once per turn, and both currents",
)

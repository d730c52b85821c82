"""A flux that is no pure sine: the voltage of the turning magnets has K w cos(n theta + phi) besides, along q."""

from __future__ import annotations

import math

from firmloop.identify.plants.assembly import Assembly
from firmloop.identify.plants.effect import Effect, EffectParameter, Scales, Site, phase, shape, signed


def parameters(site: Site) -> tuple[EffectParameter, ...]:
    """Name the constants: 6 times per electrical turn is usual, 6 p per turn of the shaft."""
    return (signed("amplitude_V_s_rad", "V*s/rad"), shape("periods_per_rev", "", 1.0), phase("phase_rad"))


def starts(site: Site, scales: Scales) -> tuple[tuple[float, ...], ...]:
    """Propose where a fit begins."""
    drop = scales.resistance * scales.current  # V: a drive may be told duties
    return tuple(
        (0.03 * drop / max(scales.speed, 1e-9), 6.0 * pairs, 0.5 * math.pi * k)
        for pairs in (1.0, 2.0, 3.0, 4.0, 5.0, 7.0, 11.0)
        for k in range(2)
    )


def attach(assembly: Assembly, site: Site, values: tuple[float, ...]) -> None:
    """Add it to a simulation: the power that it takes from the current is that of its torque."""
    rate = (0.0, values[1], 0.0, 0.0, 0.0, 0.0)
    row = assembly.row[site.balance]
    assembly.add_term(row, "harmonic_voltage", values, assembly.per[site.balance], rate)
    torque = (*values, float(row))
    assembly.add_term(assembly.speed, "harmonic_torque", torque, assembly.per[assembly.bodies[0]], rate)


EFFECT = Effect(
    name="flux_harmonics",
    equation="voltage",
    place="axes",
    term="-K w cos(n theta + phi) along q, and 3/2 K cos(n theta + phi) iq of torque",
    says="the flux of the magnets is no pure sine: current and torque ripple with the angle",
    parameters=parameters,
    starts=starts,
    confusable_with=("torque_ripple", "cogging_torque", "dead_time"),
    experiment="spin it with its terminals open: the voltage between two of them, less its sine",
    rotary_only=True,
    needs_position=True,
    attach=attach,
    codes=(
        ("harmonic_voltage", "    return -q[0] * v->w * cos(q[1] * v->turn + q[2]);"),
        ("harmonic_torque", "    return 1.5 * q[0] * cos(q[1] * v->turn + q[2]) * v->x[(int)q[3]];"),
    ),
    switches=(0,),
    unmet="a current loop is too slow for it at speed",
    coordinate="position, several times per turn, and speed",
)

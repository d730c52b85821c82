"""Magnets that the winding warms: their flux falls by beta dT, dT follows 3/2 R i^2 with a first-order lag."""

from __future__ import annotations

from firmloop.identify.plants.assembly import STEADY, Assembly
from firmloop.identify.plants.effect import Effect, EffectParameter, Scales, Site, shape, size

_NEODYMIUM = 0.0011  # 1/K: remanence of sintered NdFeB from 20 to 100 degC (IEC 60404-8-1)


def parameters(site: Site) -> tuple[EffectParameter, ...]:
    """Name the constants."""
    return (size("rise_K_per_W", "K/W"), shape("time_constant_s", "s", 1.0))


def starts(site: Site, scales: Scales) -> tuple[tuple[float, ...], ...]:
    """Propose where a fit begins."""
    power = max(1.5 * scales.resistance * (0.5 * scales.current) ** 2, 1e-12)
    return tuple((30.0 / power, share * scales.span) for share in (0.2, 1.0))


def attach(assembly: Assembly, site: Site, values: tuple[float, ...]) -> None:
    """Add it to a simulation."""
    rise, lag = values
    warm = assembly.add_state(lambda x: 0.0)
    assembly.a[warm, warm] = -1.0 / lag
    fallen = assembly.value("pole_pairs") * assembly.value("flux_Wb") * _NEODYMIUM
    constants = (fallen, float(warm))
    assembly.add_term(warm, "magnet_power", (1.5 * assembly.value("R_ohm"),), rise / lag, STEADY)
    assembly.add_term(1, "magnet_voltage", constants, assembly.per[site.balance], STEADY)
    assembly.add_term(assembly.speed, "magnet_torque", constants, assembly.per[assembly.bodies[0]], STEADY)


EFFECT = Effect(
    name="magnet_heating",
    equation="voltage",
    place="axes",
    term="psi (1 - beta dT), tau d(dT)/dt = rise 3/2 R i^2 - dT",
    says="the magnets warm up and their flux falls",
    parameters=parameters,
    starts=starts,
    confusable_with=("resistance_heating", "stator_saturation", "load_step"),
    experiment="the same run at constant speed cold and after minutes under load",
    rotary_only=True,
    needs_position=False,
    attach=attach,
    codes=(
        ("magnet_power", "    return q[0] * (v->x[0] * v->x[0] + v->x[1] * v->x[1]);"),
        ("magnet_voltage", "    return q[0] * v->x[(int)q[1]] * v->w;"),
        ("magnet_torque", "    return -1.5 * q[0] * v->x[(int)q[1]] * v->x[1];"),
    ),
    switches=(0,),
    unmet="the temperature is not measured; the integral meets it",
    coordinate="heat of the magnets",
)

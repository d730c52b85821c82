"""A torque constant that falls with the current: kt / (1 + (i/isat)^2)."""

from __future__ import annotations

from firmloop.identify.plants.assembly import Assembly
from firmloop.identify.plants.effect import Effect, EffectParameter, Scales, Site, ceiling


def parameters(site: Site) -> tuple[EffectParameter, ...]:
    """Name the constants."""
    return (ceiling("current_A", "A"),)


def starts(site: Site, scales: Scales) -> tuple[tuple[float, ...], ...]:
    """Propose where a fit begins."""
    return ((1.5 * scales.current,), (4.0 * scales.current,))


def attach(assembly: Assembly, site: Site, values: tuple[float, ...]) -> None:
    """Add it to a simulation."""
    rate = assembly.current_settles()
    assembly.add_term(assembly.speed, "torque_saturation", values, assembly.per[site.balance], rate)


EFFECT = Effect(
    name="torque_constant_saturation",
    equation="torque",
    place="current",
    term="kt / (1 + (i/isat)^2)",
    says="the iron saturates: the torque grows less than the current",
    parameters=parameters,
    starts=starts,
    confusable_with=("load_dependent_friction", "load_torque", "inductance_saturation"),
    experiment="two levels of current at the same speed",
    rotary_only=False,
    needs_position=False,
    attach=attach,
    codes=(
        (
            "torque_saturation",
            """    const double r = v->i * v->i / (q[0] * q[0]);
    return -v->effort * r / (1.0 + r);""",
        ),
    ),
    switches=(0,),
    unmet="it lowers the gain at large currents; the integral meets it",
    coordinate="current squared",
)

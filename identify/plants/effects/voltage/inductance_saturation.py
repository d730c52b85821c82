"""An inductance that falls with the current: L / (1 + (i/isat)^2)."""

from __future__ import annotations

from firmloop.identify.plants.assembly import Assembly
from firmloop.identify.plants.effect import Effect, EffectParameter, Scales, Site, ceiling


def parameters(site: Site) -> tuple[EffectParameter, ...]:
    """Name the constants."""
    return (ceiling("current_A", "A"),)


def starts(site: Site, scales: Scales) -> tuple[tuple[float, ...], ...]:
    """Propose where a fit begins."""
    return ((1.0 * scales.current,), (3.0 * scales.current,))


def attach(assembly: Assembly, site: Site, values: tuple[float, ...]) -> None:
    """Add it to a simulation."""
    slow, _, _, _, _, quick = assembly.current_settles()
    # The derivative is scaled by up to (i/isat)^2: steps stay where an explicit formula is stable, long ones too.
    rate = (slow, 0.0, 0.0, quick / values[0] ** 2, 0.0, 10.0 * quick)
    assembly.add_factor(assembly.row[site.balance], "inductance", values, rate)


EFFECT = Effect(
    name="inductance_saturation",
    equation="voltage",
    place="voltage",
    term="L / (1 + (i/isat)^2)",
    says="the iron saturates: the current rises faster where it is large",
    parameters=parameters,
    starts=starts,
    confusable_with=("torque_constant_saturation",),
    experiment="voltage steps with a locked shaft at two sizes",
    rotary_only=False,
    needs_position=False,
    attach=attach,
    codes=(
        (
            "inductance",
            """    return v->i * v->i / (q[0] * q[0]);""",
        ),
    ),
    switches=(0,),
    unmet="it acts while the current changes and leaves nothing to hold",
    coordinate="current squared and its slope",
)

"""The voltage drop of brushes or of a driver: -V sign(i); no current flows below it."""

from __future__ import annotations

from firmloop.identify.plants.assembly import STEADY, Assembly
from firmloop.identify.plants.effect import Effect, EffectParameter, Holding, Scales, Site, size


def parameters(site: Site) -> tuple[EffectParameter, ...]:
    """Name the constants."""
    return (size("voltage_V", "V"),)


def starts(site: Site, scales: Scales) -> tuple[tuple[float, ...], ...]:
    """Propose where a fit begins."""
    return ((0.03 * scales.input,), (0.1 * scales.input,))


def attach(assembly: Assembly, site: Site, values: tuple[float, ...]) -> None:
    """Add it to a simulation."""
    assembly.add_level(site.balance, "brush_level", values, STEADY)


def holding(site: Site, values: tuple[float, ...]) -> Holding:
    """Return what meets it."""
    return Holding(up=values[0], down=values[0])


EFFECT = Effect(
    name="brush_drop",
    equation="voltage",
    place="voltage",
    term="-V sign(i)",
    says="brushes or the driver drop a constant voltage in the direction of the current",
    parameters=parameters,
    starts=starts,
    confusable_with=("dead_zone", "coulomb_friction"),
    experiment="slow reversals at constant current",
    rotary_only=False,
    needs_position=False,
    attach=attach,
    codes=(
        (
            "brush_level",
            """    (void)v;
    return q[0];""",
        ),
    ),
    switches=(0,),
    holding=holding,
    coordinate="sign of current",
)

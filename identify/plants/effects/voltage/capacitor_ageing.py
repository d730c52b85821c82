"""A capacitor that has lost capacitance: C (1 - loss)."""

from __future__ import annotations

from firmloop.identify.plants.assembly import STEADY, Assembly
from firmloop.identify.plants.effect import Effect, EffectParameter, Scales, Site


def parameters(site: Site) -> tuple[EffectParameter, ...]:
    """Name the constants."""
    return (EffectParameter("loss", "", 0.0, 0.9, 0.0, False, None),)


def starts(site: Site, scales: Scales) -> tuple[tuple[float, ...], ...]:
    """Propose where a fit begins."""
    return ((0.02,), (0.1,), (0.3,))


def attach(assembly: Assembly, site: Site, values: tuple[float, ...]) -> None:
    """Add it to a simulation."""
    assembly.add_factor(assembly.row[site.balance], "capacitor_loss", values, STEADY)


EFFECT = Effect(
    name="capacitor_ageing",
    equation="voltage",
    place="capacitor",
    term="C (1 - loss)",
    says="the capacitor has lost a part of its capacitance",
    parameters=parameters,
    starts=starts,
    confusable_with=("sensor_gain", "sensor_delay", "sensor_lag", "input_saturation"),
    experiment="the capacitor's voltage recorded beside its current",
    rotary_only=False,
    needs_position=False,
    attach=attach,
    codes=(
        (
            "capacitor_loss",
            """    return q[0] / (1.0 - q[0]);""",
        ),
    ),
    switches=(0,),
)

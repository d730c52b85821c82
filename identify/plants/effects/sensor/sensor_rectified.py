"""A sensor that loses the sign: abs(y)."""

from __future__ import annotations

from firmloop.identify.plants.assembly import Assembly
from firmloop.identify.plants.effect import Effect, EffectParameter, Scales, Site

_OPPOSITE = 0.5  # of the largest reading, on the other side: no noise or offset reaches that far


def parameters(site: Site) -> tuple[EffectParameter, ...]:
    """Name the constants; noise around zero makes a fitted share a little less than one."""
    return (EffectParameter("share", "", 0.8, 1.0, 0.0, False, 1.0),)


def starts(site: Site, scales: Scales) -> tuple[tuple[float, ...], ...]:
    """Propose where a fit begins."""
    return ((1.0,),)


def attach(assembly: Assembly, site: Site, values: tuple[float, ...]) -> None:
    """Add it to a simulation."""
    assembly.map_output(site.output, "sensor_rectified", values)


def possible(site: Site, scales: Scales) -> bool:
    """Tell whether readings stay on one side, but for noise and an offset."""
    return min(-scales.output_low, scales.output_high) <= _OPPOSITE * scales.output


EFFECT = Effect(
    name="sensor_rectified",
    equation="sensor",
    place="sensor",
    term="abs(y)",
    says="the sensor shows the size without the sign",
    parameters=parameters,
    starts=starts,
    confusable_with=(),
    experiment="motion in both directions",
    rotary_only=False,
    needs_position=False,
    attach=attach,
    codes=(
        (
            "sensor_rectified",
            """    return v->y + q[0] * (fabs(v->y) - v->y);""",
        ),
    ),
    switches=(0,),
    possible=possible,
    stage=7,
    seen_by="folds",
)

"""An actuator that follows no faster than a rate: the slope of the input is clipped."""

from __future__ import annotations

from collections.abc import Sequence

from firmloop.identify.plants.assembly import Assembly
from firmloop.identify.plants.effect import Effect, EffectParameter, Scales, Site, ceiling, ended


def parameters(site: Site) -> tuple[EffectParameter, ...]:
    """Name the constants."""
    return (ceiling(f"{ended('rate', site.input)}_s", site.input_rate),)


def starts(site: Site, scales: Scales) -> tuple[tuple[float, ...], ...]:
    """Propose where a fit begins: closely, as every row that just reaches the rate bends the cost.

    A held input jumps between its rows, so that a rate above its slope from row to row shows, too.
    """
    return tuple((share * scales.slew,) for share in (0.1, 0.02, 0.25, 0.5, 1.5, 0.008))


def believable(values: Sequence[float], scales: Scales) -> bool:
    """Tell whether the actuator gets to its largest command while it is watched: else it answers nothing."""
    return values[0] * scales.span > scales.input


def attach(assembly: Assembly, site: Site, values: tuple[float, ...]) -> None:
    """Add it to a simulation."""
    assembly.timing.slew = values[0]


EFFECT = Effect(
    name="slew_rate_limit",
    equation="actuator",
    place="actuator",
    term="abs(du/dt) <= rate",
    says="the actuator follows its command no faster than a rate",
    parameters=parameters,
    starts=starts,
    confusable_with=("input_delay", "sensor_lag"),
    experiment="two sizes of step: the error lasts longer for the larger one",
    rotary_only=False,
    needs_position=False,
    attach=attach,
    codes=(),
    switches=(0,),
    unmet="what the actuator does not give cannot be asked for; set rate_limit_per_s to its slope",
    coordinate="slope of the input",
    screened=False,
    believable=believable,
    regime="quick input",
)

"""A command that acts late: u(t - d)."""

from __future__ import annotations

from firmloop.identify.plants.assembly import Assembly
from firmloop.identify.plants.effect import Effect, EffectParameter, Scales, Site, size, within
from firmloop.identify.plants.plant import Plant


def parameters(site: Site) -> tuple[EffectParameter, ...]:
    """Name the constants."""
    return (size("delay_s", "s"),)


def starts(site: Site, scales: Scales) -> tuple[tuple[float, ...], ...]:
    """Propose where a fit begins."""
    return tuple((time,) for time in scales.times(0.5))


def attach(assembly: Assembly, site: Site, values: tuple[float, ...]) -> None:
    """Add it to a simulation."""
    assembly.timing.input_delay = values[0]


def fits(plant: Plant) -> bool:
    """Tell whether the plant has no delay of its own, which says the same."""
    return plant.delay is None


EFFECT = Effect(
    name="input_delay",
    equation="actuator",
    place="actuator",
    term="u(t - d)",
    says="the command acts late",
    parameters=parameters,
    starts=starts,
    confusable_with=("slew_rate_limit", "sensor_delay", "sensor_lag"),
    experiment="fast random steps of two sizes",
    rotary_only=False,
    needs_position=False,
    attach=attach,
    codes=(),
    switches=(0,),
    unmet="no input acts before it is given; the margins count with it",
    coordinate="change of the input",
    believable=within,
    late=True,
    fits=fits,
    regime="quick input",
)

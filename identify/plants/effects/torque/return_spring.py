"""A spring to the origin: -k theta."""

from __future__ import annotations

from firmloop.identify.plants.assembly import Assembly
from firmloop.identify.plants.effect import Effect, EffectParameter, Holding, Scales, Site, size


def parameters(site: Site) -> tuple[EffectParameter, ...]:
    """Name the constants."""
    return (size(f"stiffness_{site.stiffness}", site.force_per(1)),)


def starts(site: Site, scales: Scales) -> tuple[tuple[float, ...], ...]:
    """Propose where a fit begins."""
    return ((0.1 * scales.effort / scales.travel,), (1.0 * scales.effort / scales.travel,))


def possible(site: Site, scales: Scales) -> bool:
    """Tell whether the machine comes back: what it winds up for ever is a load that grows with time."""
    return scales.comes_back


def attach(assembly: Assembly, site: Site, values: tuple[float, ...]) -> None:
    """Add it to a simulation."""
    assembly.a[assembly.speed, assembly.position] -= assembly.per[site.balance] * values[0]


def holding(site: Site, values: tuple[float, ...]) -> Holding:
    """Return what meets it."""
    return Holding(spring=values[0])


EFFECT = Effect(
    name="return_spring",
    equation="torque",
    place="torque",
    term="-k theta",
    says="a spring pulls back to the origin",
    parameters=parameters,
    starts=starts,
    confusable_with=("gravity_torque", "hardening_spring", "presliding_friction"),
    experiment="let go from two deflections",
    rotary_only=False,
    needs_position=True,
    attach=attach,
    codes=(),
    switches=(0,),
    holding=holding,
    coordinate="position",
    possible=possible,
    regime="way back",
    slow=True,
)

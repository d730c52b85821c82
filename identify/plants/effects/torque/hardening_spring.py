"""A spring that hardens: -k3 theta^3."""

from __future__ import annotations

from firmloop.identify.plants.assembly import Assembly, ringing
from firmloop.identify.plants.effect import Effect, EffectParameter, Holding, Scales, Site, size
from firmloop.identify.plants.effects.torque.return_spring import possible


def parameters(site: Site) -> tuple[EffectParameter, ...]:
    """Name the constants."""
    return (size("cubic_N_m_rad3" if site.rotary else "cubic_N_m3", site.force_per(3)),)


def starts(site: Site, scales: Scales) -> tuple[tuple[float, ...], ...]:
    """Propose where a fit begins."""
    return (
        (0.1 * scales.effort / scales.travel**3,),
        (1.0 * scales.effort / scales.travel**3,),
        (10.0 * scales.effort / scales.travel**3,),
    )


def attach(assembly: Assembly, site: Site, values: tuple[float, ...]) -> None:
    """Add it to a simulation."""
    rate = ringing(3.0 * values[0], assembly.per[site.balance])
    assembly.add_term(assembly.speed, "hardening", values, assembly.per[site.balance], (0.0, 0.0, 0.0, 0.0, rate, 0.0))


def holding(site: Site, values: tuple[float, ...]) -> Holding:
    """Return what meets it."""
    return Holding(cubic=values[0])


EFFECT = Effect(
    name="hardening_spring",
    equation="torque",
    place="torque",
    term="-k3 theta^3",
    says="a spring grows stiffer with deflection",
    parameters=parameters,
    starts=starts,
    confusable_with=("return_spring", "end_stop"),
    experiment="vibrate at two amplitudes: the frequency rises with amplitude",
    rotary_only=False,
    needs_position=True,
    attach=attach,
    codes=(
        (
            "hardening",
            """    return -q[0] * v->th * v->th * v->th;""",
        ),
    ),
    switches=(0,),
    holding=holding,
    coordinate="position cubed",
    possible=possible,
    regime="way back",
    slow=True,
)

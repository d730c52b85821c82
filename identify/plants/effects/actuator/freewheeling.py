"""A driver that does not brake: current flows only the way its voltage points, and a faster motor runs free."""

from __future__ import annotations

from firmloop.identify.plants.assembly import Assembly
from firmloop.identify.plants.effect import Effect, EffectParameter, Scales, Site
from firmloop.identify.plants.plant import Plant

_LITTLE = 0.02  # of the largest input: what falls by less drives all the time


def parameters(site: Site) -> tuple[EffectParameter, ...]:
    """Name the constants; of a motor it is the share of the driver's braking, of a lag that of all, unknown."""
    return (EffectParameter("share", "", 0.0, 1.0, 0.0, False, None if site.lag else 1.0),)


def starts(site: Site, scales: Scales) -> tuple[tuple[float, ...], ...]:
    """Propose where a fit begins."""
    return ((0.4,), (0.7,), (0.9,)) if site.lag else ((1.0,),)


def possible(site: Site, scales: Scales) -> bool:
    """Tell whether the input ever falls, so that the motor may be faster than it.

    Of a lag whose input goes both ways nothing tells what brakes: that of a bridge does.
    """
    little = _LITTLE * scales.input
    return scales.fall > little and not (site.lag and scales.other_way > little)


def fits(plant: Plant) -> bool:
    """Tell whether one voltage drives a current, or one input a lag of first order."""
    moving = [balance.state for balance in plant.balances if balance.kind in ("torque", "force")]
    winding = any(balance.kind == "voltage" for balance in plant.balances)
    return len(plant.inputs) == 1 and bool(moving) and (winding or (plant.delay is not None and moving[0] == 0))


def attach(assembly: Assembly, site: Site, values: tuple[float, ...]) -> None:
    """Add it to a simulation."""
    winding = assembly.winding()
    balance = winding if winding >= 0 else site.balance
    row, per = assembly.row[balance], assembly.per[balance]
    by_speed = -float(assembly.a[row, assembly.speed]) / per
    if winding < 0:
        braking = values[0] * by_speed
        assembly.add_term(row, "free_lag", (braking,), per, (abs(braking * per), 0.0, 0.0, 0.0, 0.0, 0.0))
    else:
        by_input = float(assembly.b[row, 0]) / per
        assembly.add_level(balance, "free_winding", (values[0], by_speed, by_input), assembly.current_settles())


EFFECT = Effect(
    name="freewheeling",
    equation="actuator",
    place="current",
    term="i u >= 0",
    says="the drive pushes but does not brake: what is above its command comes down by itself",
    parameters=parameters,
    starts=starts,
    confusable_with=("coulomb_friction", "quadratic_drag", "load_torque"),
    experiment="let it slow down from full speed, once at no voltage and once with the terminals open",
    rotary_only=False,
    needs_position=False,
    attach=attach,
    codes=(
        (
            "free_winding",
            """    const double drive = q[2] * v->u[0], pull = drive - q[1] * v->w;
    return v->s * drive <= 0.0 && v->s * pull > 0.0 ? q[0] * (1.0 + 1e-9) * fabs(pull) : 0.0;""",
        ),
        (
            "free_lag",
            """    const double pull = v->effort - q[0] * v->w;
    return v->effort * v->w >= 0.0 && pull * v->w < 0.0 ? -pull : 0.0;""",
        ),
    ),
    switches=(0,),
    screened=False,
    possible=possible,
    fits=fits,
    unmet="the driver does not brake; a reference that falls no faster than the machine runs out stays met",
    coordinate="braking",
)

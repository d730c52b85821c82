"""A winding that warms up: R (1 + alpha dT), dT follows i^2 R with a first-order lag; alpha is that of copper."""

from __future__ import annotations

from firmloop.identify.plants.assembly import Assembly
from firmloop.identify.plants.effect import Effect, EffectParameter, Scales, Site, shape, size
from firmloop.identify.plants.plant import Plant

_COPPER = 0.00393  # 1/K, temperature coefficient of resistance of copper at 20 degC (IEC 60028)


def parameters(site: Site) -> tuple[EffectParameter, ...]:
    """Name the constants."""
    return (size("rise_K_per_W", "K/W"), shape("time_constant_s", "s", 1.0))


def starts(site: Site, scales: Scales) -> tuple[tuple[float, ...], ...]:
    """Propose where a fit begins."""
    return tuple(
        (warm / max(scales.resistance * (0.5 * scales.current) ** 2, 1e-12), share * scales.span)
        for warm in (10.0, 40.0)
        for share in (0.2, 1.0)
    )


def attach(assembly: Assembly, site: Site, values: tuple[float, ...]) -> None:
    """Add it to a simulation."""
    if assembly.plant.balances[site.balance].inside:
        return  # the equations of the plant hold it
    rise, lag = values
    row, per = assembly.row[site.balance], assembly.per[site.balance]
    resistance = assembly.forms.balances[site.balance].resistance
    rate = assembly.current_settles()
    warm = assembly.add_state(lambda x: 0.0)
    assembly.a[warm, warm] = -1.0 / lag
    assembly.add_term(row, "heating_drop", (resistance * _COPPER, float(warm)), per, rate)
    assembly.add_term(warm, "heating_power", (resistance, _COPPER, float(warm)), rise / lag, rate)


def fits(plant: Plant) -> bool:
    """Tell whether a winding of the plant has a resistance."""
    return any(balance.resistance is not None for balance in plant.balances)


EFFECT = Effect(
    name="resistance_heating",
    equation="voltage",
    place="voltage",
    term="-R alpha dT i, tau d(dT)/dt = rise R (1 + alpha dT) i^2 - dT",
    says="the winding warms up and its resistance with it",
    parameters=parameters,
    starts=starts,
    confusable_with=("supply_sag", "brush_drop", "load_step"),
    experiment="the same short test cold and after minutes under load",
    rotary_only=False,
    needs_position=False,
    attach=attach,
    codes=(
        (
            "heating_drop",
            """    return -q[0] * v->x[(int)q[1]] * v->i;""",
        ),
        (
            "heating_power",
            """    return q[0] * (1.0 + q[1] * v->x[(int)q[2]]) * v->i * v->i;""",
        ),
    ),
    switches=(0,),
    unmet="the temperature is not measured; the integral meets it",
    coordinate="heat of the winding",
    fits=fits,
)

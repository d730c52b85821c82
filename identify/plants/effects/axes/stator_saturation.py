"""Iron of the stator that saturates: an axis has the flux L isat atan(i/isat), whose slope is L/(1 + (i/isat)^2)."""

from __future__ import annotations

from firmloop.identify.plants.assembly import Assembly
from firmloop.identify.plants.effect import Effect, EffectParameter, Scales, Site, ceiling

_MOST = 10.0  # times that an inductance is expected to fall: what steps are kept short for
_LOST = "    const double d = q[0] * (q[2] * atan(v->x[0] / q[2]) - v->x[0]);\n"
_ACROSS = "    const double c = q[1] * (q[2] * atan(v->x[1] / q[2]) - v->x[1]);\n"


def parameters(site: Site) -> tuple[EffectParameter, ...]:
    """Name the constants: isat is the current at which an inductance has fallen by half."""
    return (ceiling("current_A", "A"),)


def starts(site: Site, scales: Scales) -> tuple[tuple[float, ...], ...]:
    """Propose where a fit begins."""
    return ((1.0 * scales.current,), (3.0 * scales.current,))


def attach(assembly: Assembly, site: Site, values: tuple[float, ...]) -> None:
    """Add it to a simulation: the other axis' voltage and the torque follow from the flux too."""
    along, across = assembly.value("Ld_H"), assembly.value("Lq_H")
    pairs, resistance = assembly.value("pole_pairs"), assembly.value("R_ohm")
    constants = (along, across, values[0], pairs)
    rate = (_MOST * resistance / min(along, across), pairs, 0.0, 0.0, 0.0, 0.0)
    assembly.add_term(0, "saturated_d", constants, 1.0 / along, rate)
    assembly.add_term(1, "saturated_q", constants, 1.0 / across, rate)
    assembly.add_term(assembly.speed, "saturated_torque", constants, assembly.per[assembly.bodies[0]], rate)
    for row in (0, 1):
        assembly.add_factor(row, "saturated_slope", (float(row), values[0]), rate)


EFFECT = Effect(
    name="stator_saturation",
    equation="voltage",
    place="axes",
    term="L isat atan(i/isat) for the flux of each axis",
    says="the iron of the stator saturates: the current rises faster where it is large",
    parameters=parameters,
    starts=starts,
    confusable_with=("resistance_heating", "magnet_heating"),
    experiment="steps of the voltage with a locked rotor at two sizes",
    rotary_only=True,
    needs_position=False,
    attach=attach,
    codes=(
        ("saturated_d", _ACROSS + "    return q[3] * v->w * c;"),
        ("saturated_q", _LOST + "    return -q[3] * v->w * d;"),
        ("saturated_torque", _LOST + _ACROSS + "    return 1.5 * q[3] * (d * v->x[1] - c * v->x[0]);"),
        ("saturated_slope", "    return v->x[(int)q[0]] * v->x[(int)q[0]] / (q[1] * q[1]);"),
    ),
    switches=(0,),
    unmet="it raises the gain of the loop at large currents; a lower bandwidth meets it",
    coordinate="current squared and its slope",
)

"""Current sensors of two phases whose zeros are off, under a drive that logs d and q: its log circles backwards."""

from __future__ import annotations

from firmloop.identify.plants.assembly import Assembly
from firmloop.identify.plants.effect import Effect, EffectParameter, Scales, Site, signed
from firmloop.identify.plants.plant import Plant

_AXES = {"current_d_A": "d", "current_q_A": "q"}
_PHASES = {"current_a_A": 0, "current_b_A": 1}
_SHOWN = "    const double along = q[0], across = (q[0] + 2.0 * q[1]) / 1.7320508075688772, e = q[2] * v->turn;\n"


def parameters(site: Site) -> tuple[EffectParameter, ...]:
    """Name the constants."""
    return (signed("offset_a_A", "A"), signed("offset_b_A", "A"))


def starts(site: Site, scales: Scales) -> tuple[tuple[float, ...], ...]:
    """Propose where a fit begins."""
    small = 0.02 * scales.current
    return ((small, 0.0), (-small, 0.0), (0.0, small), (0.0, -small))


def attach(assembly: Assembly, site: Site, values: tuple[float, ...]) -> None:
    """Add it to a simulation."""
    map_currents(assembly, "offset", values)


def map_currents(assembly: Assembly, what: str, values: tuple[float, ...]) -> None:
    """Let what two phases' sensors do to their readings, as `<what>_d`, `<what>_q` and `<what>_phase`, be seen."""
    constants = (*values, assembly.value("pole_pairs"))
    for output, signal in enumerate(assembly.plant.outputs):
        if signal.name in _AXES:
            assembly.map_output(output, f"{what}_{_AXES[signal.name]}", constants)
        elif signal.name in _PHASES:
            assembly.map_output(output, f"{what}_phase", (values[_PHASES[signal.name]],))


def fits(plant: Plant) -> bool:
    """Tell whether currents along the axes are recorded; of phases each sensor has its own sensor_offset."""
    return any(b.kind == "axes" for b in plant.balances) and any(s.name in _AXES for s in plant.outputs)


EFFECT = Effect(
    name="current_offset",
    equation="sensor",
    place="axes",
    term="(oa + j (oa + 2 ob)/sqrt(3)) e^(-j p theta) in the log",
    says="the zeros of the phases' current sensors are off: what is logged ripples once per electrical turn",
    parameters=parameters,
    starts=starts,
    confusable_with=("sensor_offset", "current_gain"),
    experiment="a log with the bridges off: the sensors' zeros",
    rotary_only=True,
    needs_position=True,
    attach=attach,
    codes=(
        ("offset_d", _SHOWN + "    return v->y + cos(e) * along + sin(e) * across;"),
        ("offset_q", _SHOWN + "    return v->y + cos(e) * across - sin(e) * along;"),
        ("offset_phase", "    return v->y + q[0];"),
    ),
    switches=(0, 1),
    unmet="the loop holds what the sensors show; take their zeros before it starts",
    coordinate="position, once per electrical turn",
    stage=6,
    fits=fits,
)

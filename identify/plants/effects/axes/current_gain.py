"""Current sensors of two phases with different gains, under a drive that logs d and q: its log ripples twice a turn.

Phase c is taken from the two that are read, as the controller does.
"""

from __future__ import annotations

from firmloop.identify.plants.assembly import Assembly
from firmloop.identify.plants.effect import Effect, EffectParameter, Scales, Site
from firmloop.identify.plants.effects.axes.current_offset import fits, map_currents

_SHOWN = """    const double e = q[2] * v->turn, s = 1.7320508075688772;
    const double al = cos(e) * v->x[0] - sin(e) * v->x[1], be = sin(e) * v->x[0] + cos(e) * v->x[1];
    const double a = (q[0] - 1.0) * al, b = (q[1] - 1.0) * 0.5 * (s * be - al), m = (a + 2.0 * b) / s;
"""


def parameters(site: Site) -> tuple[EffectParameter, ...]:
    """Name the constants."""
    return tuple(EffectParameter(f"gain_{one}", "", 0.0, float("inf"), 1.0, False, None) for one in "ab")


def starts(site: Site, scales: Scales) -> tuple[tuple[float, ...], ...]:
    """Propose where a fit begins."""
    return ((1.05, 1.0), (0.95, 1.0), (1.0, 1.05), (1.0, 0.95))


def attach(assembly: Assembly, site: Site, values: tuple[float, ...]) -> None:
    """Add it to a simulation."""
    map_currents(assembly, "gain", values)


EFFECT = Effect(
    name="current_gain",
    equation="sensor",
    place="axes",
    term="ga ia and gb ib in the log, turned by the angle",
    says="the phases' current sensors have different gains: what is logged ripples twice per electrical turn",
    parameters=parameters,
    starts=starts,
    confusable_with=("sensor_gain", "current_offset"),
    experiment="a direct current through two phases in series: both sensors have to show it",
    rotary_only=True,
    needs_position=True,
    attach=attach,
    codes=(
        ("gain_d", _SHOWN + "    return v->y + cos(e) * a + sin(e) * m;"),
        ("gain_q", _SHOWN + "    return v->y + cos(e) * m - sin(e) * a;"),
        ("gain_phase", "    return q[0] * v->y;"),
    ),
    switches=(0, 1),
    unmet="the loop holds what the sensors show; match their gains",
    coordinate="position, twice per electrical turn, and current",
    stage=6,
    fits=fits,
)

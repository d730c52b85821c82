"""An encoder that was not aligned: the drive takes its d axis to be ahead of the magnets by a constant angle.

What it applies along its axes is ahead by that angle, and the currents that it logs lie behind by it.
"""

from __future__ import annotations

from firmloop.identify.plants.assembly import Assembly
from firmloop.identify.plants.effect import Effect, EffectParameter, Scales, Site, signed

_ERROR = "    const double e = q[0] + q[1] * sin(v->turn + q[2]);\n"
_LOGGED = "    const double d = v->u[0], c = v->u[1];\n"
_BRIDGES = """    const double one = v->u[3] * (2.0 * v->u[0] - v->u[1] - v->u[2]) / 3.0;
    const double other = v->u[3] * (v->u[1] - v->u[2]) / 1.7320508075688772;
    const double d = cos(v->u[4]) * one + sin(v->u[4]) * other, c = cos(v->u[4]) * other - sin(v->u[4]) * one;
"""
_D, _Q = "    return (cos(e) - 1.0) * d - sin(e) * c;", "    return sin(e) * d + (cos(e) - 1.0) * c;"
_OUTPUTS = {"current_d_A": "angle_current_d", "current_q_A": "angle_current_q"}


def parameters(site: Site) -> tuple[EffectParameter, ...]:
    """Name the constants."""
    return (signed("offset_rad", "rad"),)


def starts(site: Site, scales: Scales) -> tuple[tuple[float, ...], ...]:
    """Propose where a fit begins."""
    return ((0.1,), (-0.1,), (0.5,), (-0.5,))


def turn_axes(assembly: Assembly, offset: float, wave: float, phase: float) -> None:
    """Turn the axes of a drive by offset + wave sin(theta + phase), electrical."""
    error, wires = (offset, wave, phase), "logged" if assembly.inputs == len(("d", "q")) else "bridges"
    rate = (0.0, 1.0 if wave else 0.0, 0.0, 0.0, 0.0, 0.0)
    for row, axis in enumerate("dq"):
        per = 1.0 / assembly.value(f"L{axis}_H")
        assembly.add_term(row, f"angle_{wires}_{axis}", error, per, rate)
    for output, signal in enumerate(assembly.plant.outputs):
        if signal.name in _OUTPUTS:
            assembly.map_output(output, _OUTPUTS[signal.name], error)


def attach(assembly: Assembly, site: Site, values: tuple[float, ...]) -> None:
    """Add it to a simulation."""
    turn_axes(assembly, values[0], 0.0, 0.0)


EFFECT = Effect(
    name="angle_offset",
    equation="sensor",
    place="axes",
    term="v e^(j eps) at the winding, i e^(-j eps) in the log",
    says="the angle of the drive's axes is off by a constant: it was not aligned with the magnets",
    parameters=parameters,
    starts=starts,
    confusable_with=("angle_eccentricity", "stator_saturation"),
    experiment="a voltage along d alone at standstill: an aligned rotor does not move",
    rotary_only=True,
    needs_position=False,
    attach=attach,
    codes=(
        ("angle_logged_d", _ERROR + _LOGGED + _D),
        ("angle_logged_q", _ERROR + _LOGGED + _Q),
        ("angle_bridges_d", _ERROR + _BRIDGES + _D),
        ("angle_bridges_q", _ERROR + _BRIDGES + _Q),
        ("angle_current_d", _ERROR + "    return v->y + (cos(e) - 1.0) * v->x[0] + sin(e) * v->x[1];"),
        ("angle_current_q", _ERROR + "    return v->y - sin(e) * v->x[0] + (cos(e) - 1.0) * v->x[1];"),
    ),
    switches=(0,),
    unmet="it turns torque into field; align the encoder",
    coordinate="both voltages and both currents",
)

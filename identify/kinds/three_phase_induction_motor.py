r"""Three-phase induction motor in the stationary dq frame, fed by a balanced sine: what a symmetrical model would say.

Flux linkages as states, all referred to the stator (Krause, Wasynczuk and Sudhoff, Analysis of Electric Machinery and
Drive Systems, 2nd ed., section 4.5). With M the magnetizing inductance and n the pole pairs::

    lqs = (stator_L + M) iqs + M iqr       lqs' = vqs - Rs iqs                lds, ldr likewise
    lqr = (rotor_L + M) iqr + M iqs        lqr' = -Rr iqr + n w ldr           ldr' = -Rr idr - n w lqr
    J w' = 3/2 n (lds iqs - lqs ids) - b w - load w |w|

The input is the rms voltage V between two lines. The mains is an oscillator, so that the simulator sees how fast it
turns: vqs = sqrt(2/3) V (1 + c), vds = -sqrt(2/3) V s, with s' = we (1 + c) and c' = -we s held on their circle.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import casadi as ca

from identify.kind import Constant, Kind, equations
from identify.plant import Balance, Parameter, Plant
from identify.signal import Signal

_STATES = (
    ("stator_q_flux_V_s", "V*s"),
    ("stator_d_flux_V_s", "V*s"),
    ("rotor_q_flux_V_s", "V*s"),
    ("rotor_d_flux_V_s", "V*s"),
    ("speed_rad_s", "rad/s"),
    ("sine_1", ""),
    ("cosine_less_one_1", ""),
)
HELD = 20.0  # 1/s; by which the oscillator returns to its circle


def build(drive: Signal, outputs: tuple[Signal, ...], parameters: tuple[Parameter, ...]) -> Plant:
    """Write the equations."""
    states = tuple(Signal(name, unit, -math.inf, math.inf) for name, unit in _STATES)
    x, u, p = ca.SX.sym("x", len(states)), ca.SX.sym("u"), ca.SX.sym("p", len(parameters))
    value = dict(zip((parameter.name for parameter in parameters), ca.vertsplit(p), strict=True))
    stator_q, stator_d, rotor_q, rotor_d, speed, sine, less = ca.vertsplit(x)
    mutual = value["magnetizing_L_H"]
    own, other = value["stator_L_H"] + mutual, value["rotor_L_H"] + mutual
    determinant = own * other - mutual**2
    i_qs, i_ds = ((other * s - mutual * r) / determinant for s, r in ((stator_q, rotor_q), (stator_d, rotor_d)))
    i_qr, i_dr = ((own * r - mutual * s) / determinant for s, r in ((stator_q, rotor_q), (stator_d, rotor_d)))
    peak, electric = math.sqrt(2.0 / 3.0) * u, value["pole_pairs"] * speed
    mains, cosine = 2.0 * math.pi * value["frequency_Hz"], 1.0 + less
    back = HELD * (1.0 - sine**2 - cosine**2)
    torque = 1.5 * value["pole_pairs"] * (stator_d * i_qs - stator_q * i_ds)
    load = value["b_N_m_s_rad"] * speed + value["load_N_m_s2_rad2"] * speed * ca.fabs(speed)
    rates = [
        peak * cosine - value["stator_R_ohm"] * i_qs,
        -peak * sine - value["stator_R_ohm"] * i_ds,
        -value["rotor_R_ohm"] * i_qr + electric * rotor_d,
        -value["rotor_R_ohm"] * i_dr - electric * rotor_q,
        (torque - load) / value["J_kg_m2"],
        mains * cosine + back * sine,
        -mains * sine + back * cosine,
    ]
    readings = {"speed_rad_s": speed, "phase_current_A": i_qs, "torque_N_m": torque}
    return Plant(
        kind=KIND.name,
        states=states,
        inputs=(drive,),
        outputs=outputs,
        parameters=parameters,
        rate=equations("rate", x, u, p, ca.vertcat(*rates)),
        reading=equations("reading", x, u, p, ca.vertcat(*(readings[output.name] for output in outputs))),
        delay=None,
        balances=(Balance(kind="torque", state=4, per=ca.Function("per", [p], [1.0 / value["J_kg_m2"]])),),
    )


def shapes(step: float, span: float) -> tuple[Mapping[str, float], ...]:
    """Propose nothing: a datasheet gives a better start than any guess."""
    return ()


KIND = Kind(
    name="three_phase_induction_motor",
    constants=tuple(
        Constant(name, unit, 0.0, math.inf, open_low=not name.startswith(("b_", "load_")), guessable=False)
        for name, unit in (
            ("stator_R_ohm", "ohm"),
            ("stator_L_H", "H"),
            ("rotor_R_ohm", "ohm"),
            ("rotor_L_H", "H"),
            ("magnetizing_L_H", "H"),
            ("pole_pairs", ""),
            ("J_kg_m2", "kg*m^2"),
            ("b_N_m_s_rad", "N*m*s/rad"),
            ("load_N_m_s2_rad2", "N*m*s^2/rad^2"),
            ("frequency_Hz", "Hz"),
        )
    ),
    inputs=("voltage_rms_V",),
    outputs=("speed_rad_s", "phase_current_A", "torque_N_m"),
    build=build,
    shapes=shapes,
    scale=None,
)

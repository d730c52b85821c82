r"""Three-phase induction motor in the stationary dq frame, fed by a balanced sine: what a symmetrical model would say.

Flux linkages as states, all referred to the stator (Krause, Wasynczuk and Sudhoff, Analysis of Electric Machinery and
Drive Systems, 2nd ed., section 4.5). With M the magnetizing inductance and n the pole pairs::

    lqs = (stator_L + M) iqs + M iqr       lqs' = vqs - Rs iqs                lds, ldr likewise
    lqr = (rotor_L + M) iqr + M iqs        lqr' = -Rr iqr + n w ldr           ldr' = -Rr idr - n w lqr
    J w' = 3/2 n (lds iqs - lqs ids) - b w - load w |w|

The input is the rms voltage V between two lines. The mains is an oscillator, so that the simulator sees how fast it
turns: vqs = sqrt(2/3) V (1 + c), vds = -sqrt(2/3) V s, with s' = we (1 + c) and c' = -we s held on their circle.
M falls with the flux of the air gap where the effect magnetizing_saturation is present (`iron.py`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import casadi as ca

from firmloop.identify.plants.iron import air_gap, magnetizing_balance
from firmloop.identify.plants.kind import PlantConstant, PlantKind, equations
from firmloop.identify.plants.plant import Balance, Inside, Parameter, Plant
from firmloop.identify.signal import Signal

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


def build(inputs: tuple[Signal, ...], outputs: tuple[Signal, ...], parameters: tuple[Parameter, ...]) -> Plant:
    """Write the equations."""
    states = tuple(Signal(name, unit, -math.inf, math.inf) for name, unit in _STATES)
    x, u, p, z = ca.SX.sym("x", len(states)), ca.SX.sym("u"), ca.SX.sym("p", len(parameters)), ca.SX.sym("z", 1)
    value = dict(zip((parameter.name for parameter in parameters), ca.vertsplit(p), strict=True))
    rates, shown = _equations(x, u, value, None)
    inner_rates, inner = _equations(x, u, value, z)
    read, inner_read = (ca.vertcat(*(known[output.name] for output in outputs)) for known in (shown, inner))
    return Plant(
        kind=KIND.name,
        states=states,
        inputs=inputs,
        outputs=outputs,
        parameters=parameters,
        rate=equations("rate", x, u, p, ca.vertcat(*rates)),
        reading=equations("reading", x, u, p, read),
        delay=None,
        balances=(
            Balance(
                kind="torque",
                state=4,
                per=ca.Function("per", [p], [1.0 / value["J_kg_m2"]]),
                effort=equations("effort", x, u, p, shown["torque_N_m"]),
            ),
            magnetizing_balance(x, u, p, shown["magnetizing_A"]),
        ),
        inside=Inside(
            rate=ca.Function("rate", [x, u, p, z], [ca.densify(ca.vertcat(*inner_rates))]),
            reading=ca.Function("reading", [x, u, p, z], [ca.densify(inner_read)]),
            effort=ca.Function("effort", [x, u, p, z], [inner["torque_N_m"]]),
            neutral=(math.inf,),
        ),
    )


def _equations(
    x: ca.SX, u: ca.SX, value: Mapping[str, ca.SX], knee: ca.SX | None
) -> tuple[list[ca.SX], dict[str, ca.SX]]:
    """Return the rates and what can be read; `knee` is that of the iron in A."""
    stator_q, stator_d, rotor_q, rotor_d, speed, sine, less = ca.vertsplit(x)
    own, other = value["stator_L_H"], value["rotor_L_H"]
    gap_q, gap_d = air_gap(
        [[(stator_q, own), (rotor_q, other)], [(stator_d, own), (rotor_d, other)]], value["magnetizing_L_H"], knee
    )
    i_qs, i_ds = (stator_q - gap_q) / own, (stator_d - gap_d) / own
    i_qr, i_dr = (rotor_q - gap_q) / other, (rotor_d - gap_d) / other
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
    magnetizing = ca.sqrt((i_qs + i_qr) ** 2 + (i_ds + i_dr) ** 2)
    return rates, {
        "speed_rad_s": speed,
        "phase_current_A": i_qs,
        "torque_N_m": torque,
        "magnetizing_A": magnetizing,
    }


KIND = PlantKind(
    name="three_phase_induction_motor",
    constants=tuple(
        PlantConstant(name, unit, 0.0, math.inf, open_low=not name.startswith(("b_", "load_")), guessable=False)
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
    inputs=(("voltage_rms_V",),),
    outputs=("speed_rad_s", "phase_current_A", "torque_N_m"),
    build=build,
    scale=None,
)

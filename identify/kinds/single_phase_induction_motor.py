r"""Single-phase induction motor with a start capacitor, in its two axes: main winding and auxiliary winding.

Stationary frame, flux linkages as states, the rotor referred to the main winding (Krause, Wasynczuk and Sudhoff,
Analysis of Electric Machinery and Drive Systems, 2nd ed., section 10.4). With M the magnetizing inductance, a the
ratio of effective turns auxiliary to main, n the pole pairs::

    lm = (main_L + M) im + M iq            lm' = v - Rm im
    lq = (rotor_L + M) iq + M im           lq' = -Rr iq + n w ld
    la = (aux_L + a^2 M) ia + a M id       la' = v - Ra ia - vc,     vc' = ia / C
    ld = (rotor_L + M) id + a M ia         ld' = -Rr id - n w lq
    J w' = n (lq id - ld iq) - b w - load w |w|

The centrifugal switch opens the auxiliary winding above `switch_open_rad_s` and closes it again below
`switch_close_rad_s`; the arc ends the current with a time constant of 0.5 ms. Both resistances of the stator grow with
the winding's rise above its temperature at the start, R (1 + 0.00393 rise), and the rise follows the copper loss:
heating_time rise' = rise_K_per_W (Rm im^2 + Ra ia^2) - rise.

The input is the instantaneous voltage, or its rms value, which is then a sine of `frequency_Hz` from phase 0.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import casadi as ca

from identify.kind import Constant, Kind, equations
from identify.plant import Balance, IdentifyError, Parameter, Plant
from identify.signal import Signal

ARC = 5e-4  # s; far below a period of the mains, far above what would make the equations stiff
LATCH = 2e-3  # s; in which the switch has moved
COPPER = 0.00393  # 1/K, as in effects/resistance_heating.py

_STATES = (
    ("main_flux_V_s", "V*s"),
    ("aux_flux_V_s", "V*s"),
    ("rotor_q_flux_V_s", "V*s"),
    ("rotor_d_flux_V_s", "V*s"),
    ("capacitor_V", "V"),
    ("speed_rad_s", "rad/s"),
    ("switch_1", ""),
    ("rise_K", "K"),
)
_PHASE = Signal("phase_rad", "rad", -math.inf, math.inf)


def build(drive: Signal, outputs: tuple[Signal, ...], parameters: tuple[Parameter, ...]) -> Plant:
    """Write the equations; a state for the phase only where the input is an rms value."""
    sine = drive.name == "voltage_rms_V"
    frequency = next(parameter for parameter in parameters if parameter.name == "frequency_Hz")
    if not sine and frequency.free:
        raise IdentifyError(
            "plant.parameters.frequency_Hz is free, but the recorded voltage_V has its own frequency; set free = false"
        )
    states = (*(Signal(name, unit, -math.inf, math.inf) for name, unit in _STATES), *((_PHASE,) if sine else ()))
    x, u, p = ca.SX.sym("x", len(states)), ca.SX.sym("u"), ca.SX.sym("p", len(parameters))
    value = dict(zip((parameter.name for parameter in parameters), ca.vertsplit(p), strict=True))
    main, aux, rotor_q, rotor_d, capacitor, speed, switch, rise = ca.vertsplit(x)[: len(_STATES)]
    voltage = math.sqrt(2.0) * u * ca.sin(x[len(_STATES)]) if sine else u

    mutual, across = value["magnetizing_L_H"], value["turns_ratio"] * value["magnetizing_L_H"]
    rotor_self = value["rotor_L_H"] + mutual
    i_main, i_q = _currents(main, rotor_q, value["main_L_H"] + mutual, rotor_self, mutual)
    aux_self = value["aux_L_H"] + value["turns_ratio"] * across
    i_aux, i_d = _currents(aux, rotor_d, aux_self, rotor_self, across)
    warm = 1.0 + COPPER * rise
    r_main, r_aux = value["main_R_ohm"] * warm, value["aux_R_ohm"] * warm
    electric = value["pole_pairs"] * speed
    rotor_q_rate = -value["rotor_R_ohm"] * i_q + electric * rotor_d
    rotor_d_rate = -value["rotor_R_ohm"] * i_d - electric * rotor_q
    opened = (across * rotor_d_rate - (aux_self * rotor_self - across**2) * i_aux / ARC) / rotor_self
    torque = value["pole_pairs"] * (rotor_q * i_d - rotor_d * i_q)
    load = value["b_N_m_s_rad"] * speed + value["load_N_m_s2_rad2"] * speed * ca.fabs(speed)
    kept = ca.if_else(switch > 0.5, 1.0, 0.0)
    wanted = ca.if_else(
        speed > value["switch_open_rad_s"], 1.0, ca.if_else(speed < value["switch_close_rad_s"], 0.0, kept)
    )
    loss = r_main * i_main**2 + r_aux * i_aux**2
    rates = [
        voltage - r_main * i_main,
        ca.if_else(switch > 0.5, opened, voltage - r_aux * i_aux - capacitor),
        rotor_q_rate,
        rotor_d_rate,
        i_aux / value["capacitance_F"],
        (torque - load) / value["J_kg_m2"],
        (wanted - switch) / LATCH,
        (value["rise_K_per_W"] * loss - rise) / value["heating_time_s"],
        *([2.0 * math.pi * value["frequency_Hz"]] if sine else []),
    ]
    readings = {
        **dict(zip((signal.name for signal in states), ca.vertsplit(x), strict=True)),
        "main_current_A": i_main,
        "aux_current_A": i_aux,
        "line_current_A": i_main + i_aux,
        "torque_N_m": torque,
    }
    return Plant(
        kind=KIND.name,
        states=states,
        inputs=(drive,),
        outputs=outputs,
        parameters=parameters,
        rate=equations("rate", x, u, p, ca.vertcat(*rates)),
        reading=equations("reading", x, u, p, ca.vertcat(*(readings[output.name] for output in outputs))),
        delay=None,
        balances=(
            Balance(kind="torque", state=5, per=ca.Function("per", [p], [1.0 / value["J_kg_m2"]])),
            Balance(kind="capacitor", state=4, per=ca.Function("per", [p], [1.0 / value["capacitance_F"]])),
        ),
    )


def shapes(step: float, span: float) -> tuple[Mapping[str, float], ...]:
    """Propose nothing: the standard tests (`induction_tests.py`) give a better start than any guess."""
    return ()


def _currents(stator: ca.SX, rotor: ca.SX, own: ca.SX, other: ca.SX, mutual: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Solve two coupled flux linkages for the currents of stator and rotor."""
    determinant = own * other - mutual**2
    return (other * stator - mutual * rotor) / determinant, (own * rotor - mutual * stator) / determinant


def _positive(name: str, unit: str) -> Constant:
    return Constant(name, unit, 0.0, math.inf, open_low=True, guessable=False)


def _size(name: str, unit: str) -> Constant:
    return Constant(name, unit, 0.0, math.inf, open_low=False, guessable=False)


KIND = Kind(
    name="single_phase_induction_motor",
    constants=(
        _positive("main_R_ohm", "ohm"),
        _positive("main_L_H", "H"),
        _positive("aux_R_ohm", "ohm"),
        _positive("aux_L_H", "H"),
        _positive("rotor_R_ohm", "ohm"),
        _positive("rotor_L_H", "H"),
        _positive("magnetizing_L_H", "H"),
        _positive("turns_ratio", ""),
        _positive("pole_pairs", ""),
        _positive("capacitance_F", "F"),
        _positive("switch_open_rad_s", "rad/s"),
        _size("switch_close_rad_s", "rad/s"),
        _positive("J_kg_m2", "kg*m^2"),
        _size("b_N_m_s_rad", "N*m*s/rad"),
        _size("load_N_m_s2_rad2", "N*m*s^2/rad^2"),
        _size("rise_K_per_W", "K/W"),
        _positive("heating_time_s", "s"),
        _positive("frequency_Hz", "Hz"),
    ),
    inputs=("voltage_rms_V", "voltage_V"),
    outputs=(
        "speed_rad_s",
        "main_current_A",
        "aux_current_A",
        "line_current_A",
        "capacitor_V",
        "torque_N_m",
        "rise_K",
    ),
    build=build,
    shapes=shapes,
    scale=None,
)

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
`switch_close_rad_s`; the arc ends the current with a time constant of 1 ms. It moves within 1 rad/s and some 2 ms, so
that speeds, currents and their slopes are smooth: what a fit says of the switch, or of all that comes after it, rests
on that. Both resistances of the stator grow with the winding's rise above its temperature at the start,
R (1 + 0.00393 rise), and the rise follows the copper loss: rise = rise_K_per_W heat,
heating_time heat' = Rm im^2 + Ra ia^2 - heat.

M falls with the flux of the air gap where the effect magnetizing_saturation is present (`iron.py`), and the effect
resistance_heating adds to `rise_K_per_W` with a time constant of its own.

The input is the instantaneous voltage, or its rms value, which is then a sine of `frequency_Hz` from phase 0.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import casadi as ca

from firmloop.identify.error import IdentifyError
from firmloop.identify.plants.iron import air_gap, magnetizing_balance
from firmloop.identify.plants.kind import PlantConstant, PlantKind, equations
from firmloop.identify.plants.plant import Balance, Inside, Parameter, Plant
from firmloop.identify.signal import Signal

ARC = 1e-3  # s; far below a period of the mains, far above what would make the equations stiff
LATCH = 2e-3  # s; in which the switch moves
BAND = 1.0  # rad/s; over which it is told to: at a start of 600 rad/s^2 as long as it moves
COPPER = 0.00393  # 1/K, as in effects/resistance_heating.py

_STATES = (
    ("main_flux_V_s", "V*s"),
    ("aux_flux_V_s", "V*s"),
    ("rotor_q_flux_V_s", "V*s"),
    ("rotor_d_flux_V_s", "V*s"),
    ("capacitor_V", "V"),
    ("speed_rad_s", "rad/s"),
    ("switch_1", ""),
    ("heat_W", "W"),
)
_SPEED = 5
_PHASE = Signal("phase_rad", "rad", -math.inf, math.inf)


def build(inputs: tuple[Signal, ...], outputs: tuple[Signal, ...], parameters: tuple[Parameter, ...]) -> Plant:
    """Write the equations; a state for the phase only where the input is an rms value."""
    sine = inputs[0].name == "voltage_rms_V"
    frequency = next(parameter for parameter in parameters if parameter.name == "frequency_Hz")
    if not sine and frequency.free:
        raise IdentifyError(
            "plant.parameters.frequency_Hz is free, but the recorded voltage_V has its own frequency; set free = false"
        )
    states = (*(Signal(name, unit, -math.inf, math.inf) for name, unit in _STATES), *((_PHASE,) if sine else ()))
    x, u, p, z = ca.SX.sym("x", len(states)), ca.SX.sym("u"), ca.SX.sym("p", len(parameters)), ca.SX.sym("z", 3)
    value = dict(zip((parameter.name for parameter in parameters), ca.vertsplit(p), strict=True))
    rates, plain = _equations(x, u, value, None)
    inner_rates, inner = _equations(x, u, value, z)

    def read(readings: Mapping[str, ca.SX]) -> ca.SX:
        known = {**dict(zip((signal.name for signal in states), ca.vertsplit(x), strict=True)), **readings}
        shown: ca.SX = ca.vertcat(*(known[output.name] for output in outputs))
        return shown

    return Plant(
        kind=KIND.name,
        states=states,
        inputs=inputs,
        outputs=outputs,
        parameters=parameters,
        rate=equations("rate", x, u, p, ca.vertcat(*rates)),
        reading=equations("reading", x, u, p, read(plain)),
        delay=None,
        balances=(
            Balance(
                kind="torque",
                state=_SPEED,
                per=ca.Function("per", [p], [1.0 / value["J_kg_m2"]]),
                effort=equations("effort", x, u, p, plain["torque_N_m"]),
            ),
            Balance(kind="capacitor", state=4, per=ca.Function("per", [p], [1.0 / value["capacitance_F"]])),
            magnetizing_balance(x, u, p, plain["magnetizing_A"]),
            Balance(
                kind="winding",
                state=-1,
                per=ca.Function("per", [p], [0.0]),
                current=equations("current", x, u, p, plain["main_current_A"]),
                resistance=ca.Function("resistance", [p], [value["main_R_ohm"]]),
                inside=(1, 2),
            ),
        ),
        inside=Inside(
            rate=ca.Function("rate", [x, u, p, z], [ca.densify(ca.vertcat(*inner_rates))]),
            reading=ca.Function("reading", [x, u, p, z], [ca.densify(read(inner))]),
            effort=ca.Function("effort", [x, u, p, z], [inner["torque_N_m"]]),
            neutral=(math.inf, 0.0, 1.0),
        ),
    )


def _equations(
    x: ca.SX, u: ca.SX, value: Mapping[str, ca.SX], inside: ca.SX | None
) -> tuple[list[ca.SX], dict[str, ca.SX]]:
    """Return the rates, and what can be read beside the states.

    `inside` holds the knee of the iron in A, more rise in K/W and its time constant in s.
    """
    main, aux, rotor_q, rotor_d, capacitor, speed, switch, heat = ca.vertsplit(x)[: len(_STATES)]
    phase = ca.vertsplit(x)[len(_STATES) :]
    voltage = math.sqrt(2.0) * u * ca.sin(phase[0]) if phase else u
    knee, more, slower = (None, ca.SX(0.0), ca.SX(1.0)) if inside is None else ca.vertsplit(inside)

    mutual, turns, rotor_leak = value["magnetizing_L_H"], value["turns_ratio"], value["rotor_L_H"]
    aside = (aux / turns, value["aux_L_H"] / turns**2)  # referred to the main winding
    gap_q, gap_d = air_gap(
        [[(main, value["main_L_H"]), (rotor_q, rotor_leak)], [aside, (rotor_d, rotor_leak)]], mutual, knee
    )
    i_main, i_aux = (main - gap_q) / value["main_L_H"], (aux - turns * gap_d) / value["aux_L_H"]
    i_q, i_d = (rotor_q - gap_q) / rotor_leak, (rotor_d - gap_d) / rotor_leak

    rise = (value["rise_K_per_W"] + more) * heat
    warm = 1.0 + COPPER * rise
    r_main, r_aux = value["main_R_ohm"] * warm, value["aux_R_ohm"] * warm
    loss = r_main * i_main**2 + r_aux * i_aux**2
    heat_time = value["heating_time_s"] if inside is None else ca.if_else(more > 0.0, slower, value["heating_time_s"])
    electric = value["pole_pairs"] * speed
    torque = value["pole_pairs"] * (rotor_q * i_d - rotor_d * i_q)
    load = value["b_N_m_s_rad"] * speed + value["load_N_m_s2_rad2"] * speed * ca.fabs(speed)
    opened = _ramp((switch - 0.25) / 0.5)
    edge = value["switch_open_rad_s"] + (value["switch_close_rad_s"] - value["switch_open_rad_s"]) * opened
    rates = [
        voltage - r_main * i_main,
        voltage - r_aux * i_aux - capacitor,
        -value["rotor_R_ohm"] * i_q + electric * rotor_d,
        -value["rotor_R_ohm"] * i_d - electric * rotor_q,
        i_aux / value["capacitance_F"],
        (torque - load) / value["J_kg_m2"],
        (_ramp((speed - edge) / BAND) - switch) / LATCH,
        (loss - heat) / heat_time,
        *([2.0 * math.pi * value["frequency_Hz"]] if phase else []),
    ]
    # Where the switch is open the flux moves so that the current dies away, whatever the other windings do.
    by_flux = ca.gradient(i_aux, x)
    others = sum((by_flux[k] * rates[k] for k in (0, 2, 3)), start=ca.SX(0.0))
    rates[1] += opened * ((-i_aux / ARC - others) / by_flux[1] - rates[1])
    magnetizing = ca.sqrt((i_main + i_q) ** 2 + (turns * i_aux + i_d) ** 2)
    return rates, {
        "main_current_A": i_main,
        "aux_current_A": i_aux,
        "line_current_A": i_main + i_aux,
        "torque_N_m": torque,
        "rise_K": rise,
        "magnetizing_A": magnetizing,
    }


def _ramp(share: ca.SX) -> ca.SX:
    """Rise smoothly from 0 at 0 to 1 at 1."""
    inner = ca.fmin(ca.fmax(share, 0.0), 1.0)
    return inner**2 * (3.0 - 2.0 * inner)


def _positive(name: str, unit: str) -> PlantConstant:
    return PlantConstant(name, unit, 0.0, math.inf, open_low=True, guessable=False)


def _size(name: str, unit: str) -> PlantConstant:
    return PlantConstant(name, unit, 0.0, math.inf, open_low=False, guessable=False)


KIND = PlantKind(
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
    inputs=(("voltage_rms_V",), ("voltage_V",)),
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
    scale=None,
)

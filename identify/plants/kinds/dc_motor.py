"""Brushed DC motor: L di/dt = u - R i - ke w, J dw/dt = kt i - b w, dtheta/dt = w.

With a `gear_ratio` n, motor turns per output turn, speed and position are the output's, w = n wo, and so are the
torques of its balance: n^2 J dwo/dt = n kt i - n^2 b wo. The parameters stay those of the motor.
"""

from __future__ import annotations

import math

import casadi as ca

from firmloop.identify.error import IdentifyError
from firmloop.identify.plants.kind import PlantConstant, PlantKind, equations
from firmloop.identify.plants.plant import Balance, Parameter, Plant
from firmloop.identify.signal import Signal

GEAR = "gear_ratio"
_CURRENT = Signal("current_A", "A", -math.inf, math.inf)
_SPEED = Signal("speed_rad_s", "rad/s", -math.inf, math.inf)
_POSITION = Signal("position_rad", "rad", -math.inf, math.inf)


def build(inputs: tuple[Signal, ...], outputs: tuple[Signal, ...], parameters: tuple[Parameter, ...]) -> Plant:
    """Write the equations with as few states as the outputs need.

    L = 0 is the motor whose current follows its voltage at once, i = (u - ke w) / R: then the current is no state.
    The angle is a state only where it is an output.
    """
    values = {parameter.name: parameter for parameter in parameters}
    inductance = values["L_H"]
    if inductance.value == 0.0 and inductance.free:
        raise IdentifyError(
            "plant.parameters.L_H.value is 0 and free; give a positive start, or free = false for no inductance"
        )
    states = (
        *((_CURRENT,) if inductance.value > 0.0 else ()),
        _SPEED,
        *((_POSITION,) if _POSITION in outputs else ()),
    )
    state, voltage, constants = ca.SX.sym("x", len(states)), ca.SX.sym("u"), ca.SX.sym("p", len(parameters))
    resistance, inertia_of_current, emf, torque, inertia, friction = ca.vertsplit(constants)[:6]
    if GEAR in values:
        ratio = constants[6]
        emf, torque, inertia, friction = ratio * emf, ratio * torque, ratio**2 * inertia, ratio**2 * friction
    known = dict(zip((signal.name for signal in states), ca.vertsplit(state), strict=True))
    speed = known["speed_rad_s"]
    current = known.get("current_A", (voltage - emf * speed) / resistance)
    rates = {
        "current_A": (voltage - resistance * current - emf * speed) / inertia_of_current,
        "speed_rad_s": (torque * current - friction * speed) / inertia,
        "position_rad": speed,
    }
    readings = {"current_A": current, **known}
    return Plant(
        kind=KIND.name,
        states=states,
        inputs=inputs,
        outputs=outputs,
        parameters=parameters,
        rate=equations("rate", state, voltage, constants, ca.vertcat(*(rates[s.name] for s in states))),
        reading=equations("reading", state, voltage, constants, ca.vertcat(*(readings[o.name] for o in outputs))),
        delay=None,
        balances=(
            Balance(
                kind="torque",
                state=len(states) - (2 if _POSITION in states else 1),
                per=ca.Function("per", [constants], [1.0 / inertia]),
                position=len(states) - 1 if _POSITION in states else -1,
                effort=equations("effort", state, voltage, constants, torque * current),
                current=equations("current", state, voltage, constants, current),
            ),
            Balance(
                kind="voltage",
                state=0 if _CURRENT in states else -1,
                per=ca.Function("per", [constants], [1.0 / inertia_of_current]),
                current=equations("current", state, voltage, constants, current),
                resistance=ca.Function("resistance", [constants], [resistance]),
            ),
        ),
    )


KIND = PlantKind(
    name="dc_motor",
    constants=(
        PlantConstant("R_ohm", "ohm", 0.0, math.inf, open_low=True, guessable=False),
        PlantConstant("L_H", "H", 0.0, math.inf, open_low=False, guessable=False),
        PlantConstant("ke_V_s_rad", "V*s/rad", 0.0, math.inf, open_low=True, guessable=False),
        PlantConstant("kt_N_m_A", "N*m/A", 0.0, math.inf, open_low=True, guessable=False),
        PlantConstant("J_kg_m2", "kg*m^2", 0.0, math.inf, open_low=True, guessable=False),
        PlantConstant("b_N_m_s_rad", "N*m*s/rad", 0.0, math.inf, open_low=False, guessable=False),
    ),
    inputs=(("voltage_V",),),
    outputs=("speed_rad_s", "position_rad", "current_A"),
    build=build,
    scale=None,
    optional=lambda inputs, outputs: (PlantConstant(GEAR, "", 0.0, math.inf, open_low=True, guessable=False),),
)

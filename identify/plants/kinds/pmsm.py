r"""Permanent-magnet synchronous machine in the frame of its rotor, d along the magnets, salient or not.

With p the pole pairs and currents scaled by their amplitude (Krause, Wasynczuk and Sudhoff, Analysis of Electric
Machinery and Drive Systems, 2nd ed., section 6.5)::

    Ld did/dt = vd - R id + p w Lq iq           T = 3/2 p (psi iq + (Ld - Lq) id iq)
    Lq diq/dt = vq - R iq - p w (Ld id + psi)   J dw/dt = T - b w,   dth/dt = w
    ia = cos(p th) id - sin(p th) iq,           ib the same at p th - 2 pi/3

R and L are of one phase, psi is the amplitude of its flux; speed and position are mechanical, position 0 where d lies
on phase a.

The input is vd and vq, or the duties 0..1 of three half bridges on `supply_V`. Those, averaged over a period of the
pulses, are turned into the rotor's frame by `angle_rad`, the electrical angle that was measured. The machine has its
star point, so what the three have in common moves no current.

The effect dead_time takes V sign(i) from each phase. It needs the angle, so a phase current or the position has to be
among the outputs. Where |i| is below some 0.1 V/R the sign is a steep line, as the capacitances of a bridge make it.
"""

from __future__ import annotations

import math

import casadi as ca

from firmloop.identify.plants.kind import PlantConstant, PlantKind, equations
from firmloop.identify.plants.plant import Balance, Inside, Parameter, Plant
from firmloop.identify.signal import Signal

_STATES = (("current_d_A", "A"), ("current_q_A", "A"), ("speed_rad_s", "rad/s"))
_POSITION = Signal("position_rad", "rad", -math.inf, math.inf)
_OF_ANGLE = ("current_a_A", "current_b_A", "position_rad")  # outputs for which the angle is a state
_VOLTAGES = ("voltage_d_V", "voltage_q_V")
_TINY = 1e-24  # A^2: no phase without current divides by 0
_SOFT = 0.1  # of V/R: where a phase current changes its sign
_PHASES = (0.0, -2.0 * math.pi / 3.0, 2.0 * math.pi / 3.0)
_DUTIES = ("duty_a", "duty_b", "duty_c", "supply_V", "angle_rad")


def build(inputs: tuple[Signal, ...], outputs: tuple[Signal, ...], parameters: tuple[Parameter, ...]) -> Plant:
    """Write the equations; the angle is a state only where an output needs it."""
    turning = any(output.name in _OF_ANGLE for output in outputs)
    states = (*(Signal(name, unit, -math.inf, math.inf) for name, unit in _STATES), *((_POSITION,) if turning else ()))
    x, u, p = ca.SX.sym("x", len(states)), ca.SX.sym("u", len(inputs)), ca.SX.sym("p", len(parameters))
    resistance, along, across, flux, pairs, inertia, friction = ca.vertsplit(p)
    current_d, current_q, speed = ca.vertsplit(x)[:3]
    voltage_d, voltage_q = ca.vertsplit(u) if len(inputs) == len(_VOLTAGES) else _turned(*ca.vertsplit(u))
    electric = pairs * speed
    torque = 1.5 * pairs * (flux + (along - across) * current_d) * current_q

    def rates(lost_d: ca.SX | float, lost_q: ca.SX | float) -> ca.SX:
        return ca.vertcat(
            (voltage_d - lost_d - resistance * current_d + electric * across * current_q) / along,
            (voltage_q - lost_q - resistance * current_q - electric * (along * current_d + flux)) / across,
            (torque - friction * speed) / inertia,
            *([speed] if turning else []),
        )

    known = dict(zip((signal.name for signal in states), ca.vertsplit(x), strict=True))
    angles = [pairs * known[_POSITION.name] + ahead for ahead in _PHASES] if turning else []
    currents = [ca.cos(angle) * current_d - ca.sin(angle) * current_q for angle in angles]
    known |= dict(zip(_OF_ANGLE, currents[:2], strict=False))
    reading = ca.vertcat(*(known[output.name] for output in outputs))
    inside: Inside | None = None
    bridge: tuple[Balance, ...] = ()
    amplitude = equations("current", x, u, p, ca.sqrt(current_d**2 + current_q**2))  # of the current of a phase
    of_a_phase = ca.Function("resistance", [p], [resistance])
    if turning:
        dead = ca.SX.sym("z", 1)
        soft = (_SOFT * dead / resistance) ** 2 + _TINY
        lost = [dead * current / ca.sqrt(current**2 + soft) for current in currents]
        lost_d = sum((ca.cos(angle) * one for angle, one in zip(angles, lost, strict=True)), start=ca.SX(0.0))
        lost_q = sum((-ca.sin(angle) * one for angle, one in zip(angles, lost, strict=True)), start=ca.SX(0.0))
        inside = Inside(
            rate=ca.Function("rate", [x, u, p, dead], [ca.densify(rates(lost_d / 1.5, lost_q / 1.5))]),
            reading=ca.Function("reading", [x, u, p, dead], [ca.densify(reading)]),
            effort=ca.Function("effort", [x, u, p, dead], [torque]),
            neutral=(0.0,),
        )
        still = ca.Function("per", [p], [0.0])
        bridge = (Balance(kind="bridge", state=-1, per=still, current=amplitude, resistance=of_a_phase, inside=(0,)),)
    return Plant(
        kind=KIND.name,
        states=states,
        inputs=inputs,
        outputs=outputs,
        parameters=parameters,
        rate=equations("rate", x, u, p, rates(0.0, 0.0)),
        reading=equations("reading", x, u, p, reading),
        delay=None,
        balances=(
            Balance(
                kind="torque",
                state=2,
                per=ca.Function("per", [p], [1.0 / inertia]),
                position=3 if turning else -1,
                effort=equations("effort", x, u, p, torque),
            ),
            Balance(
                kind="axes",
                state=1,
                per=ca.Function("per", [p], [1.0 / across]),
                current=amplitude,
                resistance=of_a_phase,
            ),
            *bridge,
        ),
        inside=inside,
    )


def _turned(a: ca.SX, b: ca.SX, c: ca.SX, supply: ca.SX, angle: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Return the voltages of three duties in the rotor's frame."""
    one, other = supply * (2.0 * a - b - c) / 3.0, supply * (b - c) / math.sqrt(3.0)
    return ca.cos(angle) * one + ca.sin(angle) * other, ca.cos(angle) * other - ca.sin(angle) * one


KIND = PlantKind(
    name="pmsm",
    constants=(
        PlantConstant("R_ohm", "ohm", 0.0, math.inf, open_low=True, guessable=False),
        PlantConstant("Ld_H", "H", 0.0, math.inf, open_low=True, guessable=False),
        PlantConstant("Lq_H", "H", 0.0, math.inf, open_low=True, guessable=False),
        PlantConstant("flux_Wb", "Wb", 0.0, math.inf, open_low=True, guessable=False),
        PlantConstant("pole_pairs", "", 1.0, 1000.0, open_low=False, guessable=False, counted=True),
        PlantConstant("J_kg_m2", "kg*m^2", 0.0, math.inf, open_low=True, guessable=False),
        PlantConstant("b_N_m_s_rad", "N*m*s/rad", 0.0, math.inf, open_low=False, guessable=False),
    ),
    inputs=(_VOLTAGES, _DUTIES),
    outputs=("current_d_A", "current_q_A", "current_a_A", "current_b_A", "speed_rad_s", "position_rad"),
    build=build,
    scale=None,
)

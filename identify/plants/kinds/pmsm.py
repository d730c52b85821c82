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
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import casadi as ca

from firmloop.identify.plants.kind import PlantConstant, PlantKind, equations
from firmloop.identify.plants.plant import Balance, Parameter, Plant
from firmloop.identify.signal import Signal

_STATES = (("current_d_A", "A"), ("current_q_A", "A"), ("speed_rad_s", "rad/s"))
_POSITION = Signal("position_rad", "rad", -math.inf, math.inf)
_OF_ANGLE = ("current_a_A", "current_b_A", "position_rad")  # outputs for which the angle is a state
_VOLTAGES = ("voltage_d_V", "voltage_q_V")
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
    rates = (
        (voltage_d - resistance * current_d + electric * across * current_q) / along,
        (voltage_q - resistance * current_q - electric * (along * current_d + flux)) / across,
        (torque - friction * speed) / inertia,
        speed,
    )
    known = dict(zip((signal.name for signal in states), ca.vertsplit(x), strict=True))
    if turning:
        for name, ahead in (("current_a_A", 0.0), ("current_b_A", -2.0 * math.pi / 3.0)):
            angle = pairs * known[_POSITION.name] + ahead
            known[name] = ca.cos(angle) * current_d - ca.sin(angle) * current_q
    return Plant(
        kind=KIND.name,
        states=states,
        inputs=inputs,
        outputs=outputs,
        parameters=parameters,
        rate=equations("rate", x, u, p, ca.vertcat(*rates[: len(states)])),
        reading=equations("reading", x, u, p, ca.vertcat(*(known[output.name] for output in outputs))),
        delay=None,
        balances=(
            Balance(
                kind="torque",
                state=2,
                per=ca.Function("per", [p], [1.0 / inertia]),
                position=3 if turning else -1,
                effort=equations("effort", x, u, p, torque),
            ),
        ),
    )


def _turned(a: ca.SX, b: ca.SX, c: ca.SX, supply: ca.SX, angle: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Return the voltages of three duties in the rotor's frame."""
    one, other = supply * (2.0 * a - b - c) / 3.0, supply * (b - c) / math.sqrt(3.0)
    return ca.cos(angle) * one + ca.sin(angle) * other, ca.cos(angle) * other - ca.sin(angle) * one


def shapes(step: float, span: float) -> tuple[Mapping[str, float], ...]:
    """Propose nothing: the nameplate values are a better start than any guess."""
    return ()


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
    shapes=shapes,
    scale=None,
)

r"""Speed of a brushed DC motor without a speed sensor: an observer from voltage and current.

The motor of `identify/plants/kinds/dc_motor.py` with a constant load torque T as third state, sampled exactly for a
voltage that is held, and corrected by what the current says beyond the model (Luenberger, IEEE Trans. AC 16(6), 1971)::

    x = (i, w, T),   x[k+1] = A x + B u + K (i_measured - i),   speed = w

K puts all three poles of A - K C at exp(-bandwidth h) (Ackermann's formula; Astrom and Wittenmark, Computer-Controlled
Systems, 3rd ed., section 4.4). The state T takes up any constant torque, so that a load leaves no error of the speed;
an error of R or ke does: dw = -(dR i + dke w)/ke.

Inputs: a voltage (V) and a current (A), in either order. Output: a speed (rad/s), limited to its range. Keys: `R_ohm`,
`L_H`, `ke_V_s_rad`, `kt_N_m_A`, `J_kg_m2`, `b_N_m_s_rad` and `bandwidth_rad_s`.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import scipy

from firmloop.design.design import Design, Kind, Request
from firmloop.design.draft import Draft, Element
from firmloop.design.law import DesignError
from firmloop.design.linear.linear_law import limited_law, symbols, weighted_sum
from firmloop.design.table import check_keys, limits, positive, real
from firmloop.identify.signal import Signal

Array = npt.NDArray[np.float64]

MOTOR = ("R_ohm", "L_H", "ke_V_s_rad", "kt_N_m_A", "J_kg_m2")
KEYS = (*MOTOR, "b_N_m_s_rad", "bandwidth_rad_s", "u_min", "u_max")
UNITS = ("A", "rad/s", "N*m")


def design(request: Request) -> Design:
    """Sample the motor, place the observer's poles and write the law."""
    table, h = request.table, request.period
    check_keys(table, KEYS, "a sensorless_speed")
    units = [wire.unit for wire in request.inputs]
    if sorted(units) != ["A", "V"] or [wire.unit for wire in request.outputs] != ["rad/s"]:
        raise DesignError(
            f"controller.kind = 'sensorless_speed' has inputs in ({', '.join(units)}) and outputs in "
            f"({', '.join(wire.unit for wire in request.outputs)}); it needs one voltage in V, one current in A and "
            "one speed in rad/s: correct [signals]"
        )
    bandwidth = positive(table, "bandwidth_rad_s", None)
    if bandwidth * h > 2.0:
        raise DesignError(
            f"controller.bandwidth_rad_s = {bandwidth:g} is beyond what period_s = {h:g} allows; give at most {2 / h:g}"
        )
    a, b = _sampled([positive(table, key, None) for key in MOTOR], real(table, "b_N_m_s_rad", 0.0, 0.0), h)
    gain = observer_gain(a, math.exp(-bandwidth * h))
    closed = a.copy()
    closed[:, 0] -= gain
    z = symbols([wire.name for wire in request.inputs])
    voltage, current = z[units.index("V")], z[units.index("A")]
    x = symbols(["current_model", "speed_model", "load_model"])
    state = tuple(
        Element(symbol.name(), unit, symbol, weighted_sum([*closed[k], b[k], gain[k]], [*x, voltage, current]))
        for k, (symbol, unit) in enumerate(zip(x, UNITS, strict=True))
    )
    says = f"speed observer from voltage and current: bandwidth {bandwidth:.6g} rad/s"
    low, high = limits(table, request.outputs)
    remedy = "a higher bandwidth_rad_s forgets sooner"
    draft = Draft(says, z, state, (x[1],), {"unlimited": ("rad/s", x[1])}, remedy=remedy)
    law = limited_law(request, draft, low, high)
    figures = {f"K_{k}": float(value) for k, value in enumerate(gain, 1)} | {"bandwidth_rad_s": bandwidth}
    return Design(law, figures, None)


def _sampled(motor: list[float], friction: float, h: float) -> tuple[Array, Array]:
    """Return A (3, 3) and B (3,) of one period under a held voltage."""
    resistance, inductance, emf, torque, inertia = motor
    whole = np.zeros((4, 4))
    whole[0] = [-resistance / inductance, -emf / inductance, 0.0, 1 / inductance]
    whole[1, :3] = [torque / inertia, -friction / inertia, -1 / inertia]
    moved = scipy.linalg.expm(whole * h)
    moved[2] = [0.0, 0.0, 1.0, 0.0]  # what it is, without the rounding of the exponential
    return np.asarray(moved[:3, :3]), np.asarray(moved[:3, 3])


def observer_gain(a: Array, pole: float) -> Array:
    """Return K (n,) that puts every pole of a - K c at `pole`; c picks the first state."""
    order = len(a)
    seen = np.array([np.linalg.matrix_power(a, k)[0] for k in range(order)])
    if np.linalg.cond(seen) > 1e14:
        raise DesignError("the current does not show this motor's speed; check ke_V_s_rad, L_H and period_s")
    wanted = np.linalg.matrix_power(a - pole * np.eye(order), order)
    return np.asarray(wanted @ np.linalg.solve(seen, np.eye(order)[-1]))


KIND = Kind(
    name="sensorless_speed",
    says="speed of a DC motor from its voltage and current",
    design=design,
    example=Request(
        name="blower_speed",
        table={
            "R_ohm": 8.0,
            "L_H": 1e-3,
            "ke_V_s_rad": 0.02,
            "kt_N_m_A": 0.02,
            "J_kg_m2": 3e-6,
            "b_N_m_s_rad": 3e-6,
            "bandwidth_rad_s": 150.0,
        },
        period=0.001,
        inputs=(Signal("voltage", "V", -12.0, 12.0), Signal("current", "A", -2.0, 2.0)),
        outputs=(Signal("speed", "rad/s", -700.0, 700.0),),
        plant=None,
    ),
)

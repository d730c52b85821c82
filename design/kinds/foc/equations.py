"""Write one sample of a current loop, and bound what its integrals can hold."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import casadi as ca

from firmloop.design.design import Request
from firmloop.design.kinds.foc.dead_time import DeadTime
from firmloop.design.kinds.foc.field import Field
from firmloop.design.kinds.foc.observer import Frame, Observer
from firmloop.design.law import Flag, Law, Scalar
from firmloop.design.linear.linear_law import check_names, symbols
from firmloop.identify.signal import Signal
from firmloop.identify.simulation.bridge_columns import DUTIES

ROOM = 1.0 + 2.0**-10  # of a range beyond what exact arithmetic reaches, for rounding
WHY = "it forgets by h/tt a sample, towards what the limited voltage, the error and the decoupling ask for"
ROOT_3 = math.sqrt(3.0)


@dataclass(frozen=True, slots=True)
class Axis:
    """The gains of one current, and the inductance across it, 0 without decoupling."""

    kp: float  # V/A
    ki: float  # V/(A s)
    coupled: float  # H


@dataclass(frozen=True, slots=True)
class CurrentLoop:
    """All constants of the law."""

    period: float  # s
    d: Axis
    q: Axis
    flux: float  # Wb, 0 without decoupling
    modulation: float
    d_share: float
    tracking: float  # h/tt
    dead: DeadTime | None = None
    observer: Observer | None = None
    field: Field | None = None


def write(request: Request, loop: CurrentLoop) -> Law:
    """Write one sample."""
    wires = {wire.name: wire for wire in request.inputs}
    z = dict(zip(wires, symbols(list(wires)), strict=True))
    held_d, held_q = symbols(["integral_d", "integral_q"])
    further = (
        *(loop.observer.states() if loop.observer is not None else ()),
        *(loop.field.states() if loop.field is not None else ()),
    )
    seen = {signal.name: ca.SX.sym(signal.name) for signal, _, _ in further}
    if loop.observer is not None:
        frame = loop.observer.frame(seen, (z["reference_d_A"], z["reference_q_A"]))
    else:
        frame = Frame(z["angle_rad"], z["speed_rad_s"], z["reference_d_A"], z["reference_q_A"])
    if loop.field is not None:
        asked = frame.reference_d + loop.field.added(frame.reference_q, seen)
        frame = replace(frame, reference_d=asked)
    supply_range = wires["supply_V"]
    supply = ca.fmin(ca.fmax(z["supply_V"], supply_range.low), supply_range.high)
    cosine, sine = ca.cos(frame.angle), ca.sin(frame.angle)
    along, across = z["current_a_A"], (1.0 / ROOT_3) * (z["current_a_A"] + 2.0 * z["current_b_A"])
    i_d, i_q = cosine * along + sine * across, cosine * across - sine * along
    e_d, e_q = frame.reference_d - i_d, frame.reference_q - i_q
    v_d, v_q = loop.d.kp * e_d + held_d, loop.q.kp * e_q + held_q
    if loop.flux:
        v_d = v_d - (loop.d.coupled * frame.speed) * i_q
        v_q = v_q + (loop.q.coupled * frame.speed) * i_d + loop.flux * frame.speed
    most = loop.modulation / ROOT_3  # of the supply, as all that follows
    free_d, free_q = v_d / supply, v_q / supply
    u_d = ca.fmin(ca.fmax(free_d, -loop.d_share * most), loop.d_share * most)
    room = most**2 - u_d**2
    left = ca.sqrt(room if loop.d_share < 1.0 else ca.fmax(room, 0.0))
    u_q = ca.fmin(ca.fmax(free_q, -left), left)
    after = [
        held + (axis.ki * loop.period) * error + loop.tracking * ((limited - free) * supply)
        for held, axis, error, limited, free in (
            (held_d, loop.d, e_d, u_d, free_d),
            (held_q, loop.q, e_q, u_q, free_q),
        )
    ]
    # In halves of the supply's share, whose common part is then a sum. The three sum up to 0, so that it is half of the
    # middle one: of b and c the larger is a quarter of alpha below |side|.
    alpha, beta = cosine * u_d - sine * u_q, sine * u_d + cosine * u_q
    if loop.observer is not None:
        given = supply * alpha, supply * beta
        after += loop.observer.after(seen, frame, z["reference_q_A"], (along, across), given)
    if loop.field is not None:
        after += loop.field.after(seen, (u_d**2 + u_q**2) * (1.0 / most**2), loop.period)
    if loop.dead is not None:
        lost = loop.dead.share(frame.reference_d, frame.reference_q, (cosine, sine), supply)
        alpha, beta = alpha + lost[0], beta + lost[1]
    quarter = 0.25 * alpha
    side = (ROOT_3 / 4.0) * beta
    a, b, c = 2.0 * quarter, side - quarter, -side - quarter
    wide = ca.fabs(side)
    raised = ca.fmax(ca.fmin(a, wide - quarter), -wide - quarter) + 0.5
    halves = dict(zip(DUTIES, (a, b, c), strict=True))
    told = {name: ca.fmin(ca.fmax(2.0 * half + raised, 0.0), 1.0) for name, half in halves.items()}
    for wire in request.outputs[len(DUTIES) :] if loop.observer is not None else ():
        told[wire.name] = ca.fmin(ca.fmax(frame.angle if wire.unit == "rad" else frame.speed, wire.low), wire.high)
    named = {
        "cosine": ("1", cosine),
        "sine": ("1", sine),
        "current_d": ("A", i_d),
        "current_q": ("A", i_q),
        "voltage_d": ("V", v_d),
        "voltage_q": ("V", v_q),
        "share_d": ("1", u_d),
        "share_q": ("1", u_q),
        "quarter_alpha": ("1", quarter),
        "share_beta": ("1", beta),
        "common_and_half": ("1", raised),
    }
    check_names(request, ["integral_d", "integral_q", *named])
    stage = ca.Function(
        "law",
        [ca.vertcat(held_d, held_q, *seen.values()), ca.vertcat(*z.values())],
        [
            ca.vertcat(*after),
            ca.vertcat(*(told[wire.name] for wire in request.outputs)),
            ca.logic_or(u_d != free_d, u_q != free_q),
            ca.vertcat(*(value for _, value in named.values())),
        ],
        ["x", "z"],
        ["x_next", "u", "flags", "named"],
    )
    return Law(
        name=request.name,
        says=_says(loop),
        period=request.period,
        inputs=request.inputs,
        outputs=request.outputs,
        state=(
            *(
                Signal(name, "V", -reach, reach)
                for name, reach in zip(("integral_d", "integral_q"), _reaches(loop, wires), strict=True)
            ),
            *(signal for signal, _, _ in further),
        ),
        start=(0.0, 0.0, *(begin for _, begin, _ in further)),
        why=(WHY, WHY, *(why for _, _, why in further)),
        flags=(Flag("saturated", "the voltage stands at its limit"),),
        stages=(Scalar(stage, tuple(Signal(name, unit, -math.inf, math.inf) for name, (unit, _) in named.items())),),
        paired=False,
    )


def _reaches(loop: CurrentLoop, wires: Mapping[str, Signal]) -> tuple[float, float]:
    """Bound both integrals: I+ = (1-a) I + (ki h - a kp) e + a (v' - w ...), with a = h/tt from 0 to 1."""
    a, size = loop.tracking, {name: max(abs(wire.low), abs(wire.high)) for name, wire in wires.items()}
    vector = math.hypot(size["current_a_A"], (size["current_a_A"] + 2 * size["current_b_A"]) / ROOT_3)
    most = loop.modulation * size["supply_V"] / ROOT_3
    reaches = []
    for axis, reference, flux in ((loop.d, "reference_d_A", 0.0), (loop.q, "reference_q_A", loop.flux)):
        asked = max(size[reference], loop.observer.start if loop.observer is not None else 0.0)
        if loop.field is not None and reference == "reference_d_A":
            asked += loop.field.reach()
        error = abs(axis.ki * loop.period - a * axis.kp) * (asked + vector)
        turning = (size["speed_rad_s"] if loop.observer is None else loop.observer.fastest) * (
            axis.coupled * vector + flux
        )
        reaches.append(ROOM * (error / a + most + turning))
    return reaches[0], reaches[1]


def _says(loop: CurrentLoop) -> str:
    return (
        f"field-oriented current control: kp_d {loop.d.kp:.6g} V/A, ki_d {loop.d.ki:.6g} V/A/s, kp_q {loop.q.kp:.6g} "
        f"V/A, ki_q {loop.q.ki:.6g} V/A/s{', decoupled' if loop.flux else ''}"
        f"{f'; feedforward for dead_time, {loop.dead.voltage:.6g} V' if loop.dead else ''}"
        f"{f'; without an encoder, {loop.observer.kind} observer' if loop.observer else ''}"
    )

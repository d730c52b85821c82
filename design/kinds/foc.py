r"""Field-oriented control of the currents of a three-phase permanent-magnet machine, from two currents to three duties.

With h the period, th and w the electrical angle and speed, r the references (Krause, Wasynczuk and Sudhoff, Analysis of
Electric Machinery and Drive Systems, 2nd ed., chapter 3 for the frames; Harnefors and Nee, IEEE Trans. Ind. Appl.
34(1), 1998 for decoupling and tuning; Hava, Kerkman and Lipo, IEEE Trans. Power Electron. 14(1), 1999 for v_0)::

    i_al = i_a                              i_be = (i_a + 2 i_b)/sqrt(3)
    i_d  = cos(th) i_al + sin(th) i_be      i_q = -sin(th) i_al + cos(th) i_be
    v_d  = kp_d (r_d - i_d) + I_d - w Lq i_q
    v_q  = kp_q (r_q - i_q) + I_q + w (Ld i_d + psi)
    V    = modulation supply/sqrt(3)
    v_d' = min(max(v_d, -f V), f V)         v_q' = min(max(v_q, -R), R),   R = sqrt(V^2 - v_d'^2)
    I[k+1] = I[k] + ki h (r - i) + (h/tt) (v' - v)                         for d and q, I[0] = 0
    v_al = cos(th) v_d' - sin(th) v_q'      v_be = sin(th) v_d' + cos(th) v_q'
    v_a  = v_al      v_b, v_c = (-v_al +- sqrt(3) v_be)/2      v_0 = (max(v_a, v_b, v_c) + min(v_a, v_b, v_c))/2
    duty = min(max(0.5 + (v - v_0)/supply, 0), 1)              for a, b and c

A voltage at its limit goes to d first, up to its share f: the field is held. It is computed in shares of the supply,
v/supply, where V is a constant. At f = 1 the end of the circle is steep, and what v_d is off shows in R by its root:
with f = 0.9 the duties of `fixed` with 32 bits stay within 1e-6 of the law. The common part v_0 moves no current of a
machine with a free star point, and lets all of supply/sqrt(3) be used. The supply is taken within the range of its
signal, whose low end must be above 0.

Inputs, by name: `reference_d_A`, `reference_q_A`, `current_a_A`, `current_b_A`, `angle_rad`, `speed_rad_s`,
`supply_V`. Outputs: `duty_a`, `duty_b`, `duty_c`. For NaN, `safe_output = 0.5` puts no voltage on the machine.

Keys: `kp_d`, `ki_d`, `kp_q`, `ki_q` (V/A, V/(A s)), or `tune = "pole_zero"` with `bandwidth_rad_s`, w_c: kp = L w_c and
ki = R w_c cancel the pole of the winding. `R_ohm`, `Ld_H`, `Lq_H` and `flux_Wb` are the machine's, taken from a [plant]
of kind pmsm where they are left out. `decoupling` (default true) adds the terms with w, `modulation` (default 1) is the
share of the voltage that may be used, `d_share` (f, default 1) the part of that for d at most, `tt_s` the tracking
time (default kp/ki of the slower axis).

The sampled loop lags by 1.5 periods, one to compute and half a one to hold: its phase margin is 90 degrees less
1.5 w_c h, and must be 30 degrees or more.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import casadi as ca

from firmloop.design.design import Bench, Design, Kind, Request
from firmloop.design.law import DesignError, Flag, Law, Scalar
from firmloop.design.linear.linear_law import check_names, symbols
from firmloop.design.table import check_keys, choice, positive, real, truth
from firmloop.identify.plants.bridges import on_bridges
from firmloop.identify.signal import Signal

MACHINE = ("R_ohm", "Ld_H", "Lq_H", "flux_Wb")
GAINS = ("kp_d", "ki_d", "kp_q", "ki_q")
KEYS = (*GAINS, *MACHINE, "tune", "bandwidth_rad_s", "decoupling", "modulation", "d_share", "tt_s")
INPUTS = {
    "reference_d_A": "A",
    "reference_q_A": "A",
    "current_a_A": "A",
    "current_b_A": "A",
    "angle_rad": "rad",
    "speed_rad_s": "rad/s",
    "supply_V": "V",
}
OUTPUTS = ("duty_a", "duty_b", "duty_c")
LAG = 1.5  # periods, from reading to the middle of what is held
LEAST_MARGIN = math.radians(30.0)  # rad; below it a step of the current rings
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


def design(request: Request) -> Design:
    """Read the table, tune where it says so, and write the law."""
    table = request.table
    check_keys(table, KEYS, "a foc")
    _check_wires(request)
    tuned_by = choice(table, "tune", None, ("pole_zero",)) if "tune" in table else None
    decoupled = truth(table, "decoupling", True)
    machine = _machine(request, MACHINE if tuned_by else MACHINE[1:]) if tuned_by or decoupled else {}
    gains = _tuned(request, machine) if tuned_by else {key: positive(table, key, None) for key in GAINS}
    if not tuned_by and "bandwidth_rad_s" in table:
        raise DesignError('controller.bandwidth_rad_s has no effect on gains that are given; add tune = "pole_zero"')
    loop = CurrentLoop(
        request.period,
        Axis(gains["kp_d"], gains["ki_d"], machine["Lq_H"] if decoupled else 0.0),
        Axis(gains["kp_q"], gains["ki_q"], machine["Ld_H"] if decoupled else 0.0),
        machine["flux_Wb"] if decoupled else 0.0,
        real(table, "modulation", 1.0, 0.01, 1.0),
        real(table, "d_share", 1.0, 0.01, 1.0),
        _tracking(request, gains),
    )
    figures = {**gains, "tt_s": request.period / loop.tracking}
    if tuned_by:
        bandwidth = positive(table, "bandwidth_rad_s", None)
        figures |= {"bandwidth_rad_s": bandwidth, "phase_margin_deg": math.degrees(_margin(bandwidth, request.period))}
    asked = ("tune", "bandwidth_rad_s") if tuned_by else ()
    return Design(_law(request, loop), figures, tuned_by, gains, asked=asked, bench=bench(request, "reference_q_A"))


def bench(request: Request, told: str, measured: Signal | None = None) -> Bench | None:
    """Return the plant on bridges, at the middle of the supply; None where there is no such plant.

    `measured` is what follows the input `told`, the speed or the angle of the shaft; None is the current of q.
    """
    if request.plant is None or request.plant.kind != "pmsm" or tuple(w.name for w in request.outputs) != OUTPUTS:
        return None
    supply = next(wire for wire in request.inputs if wire.name == "supply_V")
    others = [wire for wire in request.inputs if wire.name not in (*INPUTS, told) and wire.unit in ("rad", "rad/s")]
    middle = (supply.low + supply.high) / 2.0
    return Bench(on_bridges(request.plant, middle, others, measured.name if measured else "current_q_A"), told)


def _check_wires(request: Request) -> None:
    """Refuse wires of other names or units, and a supply that can be 0."""
    for what, wires, wanted in (
        ("inputs", request.inputs, tuple(INPUTS)),
        ("outputs", request.outputs, OUTPUTS),
    ):
        names = tuple(wire.name for wire in wires)
        if sorted(names) != sorted(wanted):
            raise DesignError(
                f"controller.kind = 'foc' has the {what} ({', '.join(names)}); they must be {', '.join(wanted)}: "
                "correct [signals] or controller.outputs"
            )
    for wire in request.inputs:
        if wire.unit != INPUTS[wire.name]:
            raise DesignError(
                f"signals.{wire.name} is in '{wire.unit}'; a foc takes it in '{INPUTS[wire.name]}': convert it, "
                "angle and speed are electrical ones"
            )
        if wire.name == "supply_V" and wire.low <= 0:
            raise DesignError(
                f"signals.supply_V ranges from {wire.low:g} V; without a supply there is no duty: give the least that "
                "the drive runs on as low"
            )
    for wire in request.outputs:
        if not wire.low <= 0.0 < 1.0 <= wire.high:
            raise DesignError(f"signals.{wire.name} ranges from {wire.low:g} to {wire.high:g}; a duty is from 0 to 1")


def _machine(request: Request, keys: Sequence[str]) -> Mapping[str, float]:
    """Return the constants of the machine, from the table or from the plant."""
    plant = request.plant
    held = {p.name: p.value for p in plant.parameters} if plant is not None and plant.kind == "pmsm" else {}
    for key in keys:
        if key not in request.table and key not in held:
            raise DesignError(
                f"controller.{key} is missing; give it, or a [plant] of kind pmsm"
                + ("" if key in ("R_ohm",) or "tune" in request.table else ", or decoupling = false")
            )
    return {key: positive(request.table, key, held.get(key)) for key in keys}


def _tuned(request: Request, machine: Mapping[str, float]) -> Mapping[str, float]:
    """Cancel the pole of each axis, and leave an integrator that crosses at the bandwidth."""
    table, h = request.table, request.period
    given = [key for key in GAINS if key in table]
    if given:
        raise DesignError(
            f"controller.{given[0]} = {table[given[0]]!r} is given beside tune = 'pole_zero'; remove one of the two"
        )
    bandwidth = positive(table, "bandwidth_rad_s", None)
    quickest = min(machine["Ld_H"], machine["Lq_H"]) / machine["R_ohm"]
    if h > quickest:
        raise DesignError(
            f"period_s = {h:g} is longer than the time constant of the winding, {quickest:.3g} s: the current would be "
            "there before the next sample; give a shorter period"
        )
    if _margin(bandwidth, h) < LEAST_MARGIN:
        most = (math.pi / 2 - LEAST_MARGIN) / (LAG * h)
        raise DesignError(
            f"controller.bandwidth_rad_s = {bandwidth:g} leaves a phase margin of "
            f"{math.degrees(_margin(bandwidth, h)):.0f} degrees at period_s = {h:g}; give at most {most:.4g}"
        )
    return {
        "kp_d": machine["Ld_H"] * bandwidth,
        "ki_d": machine["R_ohm"] * bandwidth,
        "kp_q": machine["Lq_H"] * bandwidth,
        "ki_q": machine["R_ohm"] * bandwidth,
    }


def _margin(bandwidth: float, period: float) -> float:
    """Return the phase margin in rad of an integrator that crosses at `bandwidth`."""
    return math.pi / 2 - LAG * period * bandwidth


def _tracking(request: Request, gains: Mapping[str, float]) -> float:
    """Return h/tt, above 0 and at most 1."""
    slowest = max(gains[f"kp_{axis}"] / gains[f"ki_{axis}"] for axis in "dq")
    tt = positive(request.table, "tt_s", max(slowest, request.period))
    if tt < request.period:
        raise DesignError(
            f"controller.tt_s = {tt:g} is below period_s = {request.period:g}; tracking would overshoot: "
            "give at least the period"
        )
    return request.period / tt


def _law(request: Request, loop: CurrentLoop) -> Law:
    """Write one sample."""
    wires = {wire.name: wire for wire in request.inputs}
    z = dict(zip(wires, symbols(list(wires)), strict=True))
    held_d, held_q = symbols(["integral_d", "integral_q"])
    supply_range = wires["supply_V"]
    supply = ca.fmin(ca.fmax(z["supply_V"], supply_range.low), supply_range.high)
    cosine, sine = ca.cos(z["angle_rad"]), ca.sin(z["angle_rad"])
    along, across = z["current_a_A"], (1.0 / ROOT_3) * (z["current_a_A"] + 2.0 * z["current_b_A"])
    i_d, i_q = cosine * along + sine * across, cosine * across - sine * along
    e_d, e_q = z["reference_d_A"] - i_d, z["reference_q_A"] - i_q
    v_d, v_q = loop.d.kp * e_d + held_d, loop.q.kp * e_q + held_q
    if loop.flux:
        v_d = v_d - (loop.d.coupled * z["speed_rad_s"]) * i_q
        v_q = v_q + (loop.q.coupled * z["speed_rad_s"]) * i_d + loop.flux * z["speed_rad_s"]
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
    quarter, beta = 0.25 * (cosine * u_d - sine * u_q), sine * u_d + cosine * u_q
    side = (ROOT_3 / 4.0) * beta
    a, b, c = 2.0 * quarter, side - quarter, -side - quarter
    wide = ca.fabs(side)
    raised = ca.fmax(ca.fmin(a, wide - quarter), -wide - quarter) + 0.5
    halves = dict(zip(OUTPUTS, (a, b, c), strict=True))
    duties = [ca.fmin(ca.fmax(2.0 * halves[w.name] + raised, 0.0), 1.0) for w in request.outputs]
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
        [ca.vertcat(held_d, held_q), ca.vertcat(*z.values())],
        [
            ca.vertcat(*after),
            ca.vertcat(*duties),
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
        state=tuple(
            Signal(name, "V", -reach, reach)
            for name, reach in zip(("integral_d", "integral_q"), _reaches(loop, wires), strict=True)
        ),
        start=(0.0, 0.0),
        why=(WHY, WHY),
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
        error = abs(axis.ki * loop.period - a * axis.kp) * (size[reference] + vector)
        turning = size["speed_rad_s"] * (axis.coupled * vector + flux)
        reaches.append(ROOM * (error / a + most + turning))
    return reaches[0], reaches[1]


def _says(loop: CurrentLoop) -> str:
    return (
        f"field-oriented current control: kp_d {loop.d.kp:.6g} V/A, ki_d {loop.d.ki:.6g} V/A/s, kp_q {loop.q.kp:.6g} "
        f"V/A, ki_q {loop.q.ki:.6g} V/A/s{', decoupled' if loop.flux else ''}"
    )


KIND = Kind(
    name="foc",
    says="field-oriented control of the currents of a permanent-magnet machine",
    design=design,
    wires=tuple(INPUTS),
    example=Request(
        name="spindle_current",
        table={
            "tune": "pole_zero",
            "bandwidth_rad_s": 1500.0,
            "R_ohm": 0.36,
            "Ld_H": 0.2e-3,
            "Lq_H": 0.33e-3,
            "flux_Wb": 6.4e-3,
            "d_share": 0.9,
        },
        period=50e-6,
        inputs=tuple(
            Signal(name, INPUTS[name], low, high)
            for name, low, high in (
                ("reference_d_A", -3.0, 3.0),
                ("reference_q_A", -3.0, 3.0),
                ("current_a_A", -4.5, 4.5),
                ("current_b_A", -4.5, 4.5),
                ("angle_rad", -math.pi, math.pi),
                ("speed_rad_s", -1000.0, 1000.0),
                ("supply_V", 20.0, 60.0),
            )
        ),
        outputs=tuple(Signal(name, "1", 0.0, 1.0) for name in OUTPUTS),
        plant=None,
    ),
)

r"""Watch the start of a capacitor-start motor: damping, natural frequency, capacitor, and which regime it is in.

The auxiliary branch at standstill is a series circuit, v = R i + X j, where j is the current's quadrature, a quarter
period late, and X = w L - 1/(w C). L does not age, so R and X give, sample by sample, the damping ratio
z = R/2 sqrt(C/L) and the natural frequency n = 1/sqrt(L C) of that circuit, and C = 1/(L n^2). With h the period, w the
mains' angular frequency and 2 L z n = R::

    j[k] = (i[k] cos(w h) - i[k-1]) / sin(w h)
    e[k] = v - w L j + n (L/w n j - 2 L z i)                    what the model leaves of the voltage
    n[k+1] = n - g m_n e j,     z[k+1] = z + g m_z e i          least mean squares (Widrow and Stearns, 1985, ch. 6)
    m_n = h / (tau L/w n0 I^2),  m_z = h / (tau L n0 I^2)       both settle within tau at the nominal current I

and g is 1 while the speed is below `speed_limit_rad_s`, where the rotor's part of the circuit is still nearly that of
standstill, else 0: what was found then stands until the next start. R and L are those of the whole branch, rotor
included, at about that speed (`identify/bench_tests/revolving_field.py` gives them as voltage over current).

Interval: one Monte Carlo draw a sample in place of thousands at once. A twin estimate takes every step of n with a
random weight of 0 or 2, as a half-sample bootstrap does; its distance d from n and the mean of that are all that has to
be kept::

    d[k+1] = (1 - h/tau) d + b g m_n e j,      s[k+1] = s + g h/tau (2.26 sqrt(pi/2) |d| - s)/4

s is the half width of the 95 % interval, within the range of its signal: the mean distance of a normal variable is
sqrt(2/pi) deviations, and 2.26 is Student's factor, for s averages |d|, which forgets in tau/2, over 4 tau: some
2 x 4 + 1 = 9 distances.

b = +-1 is the sign of x, x[k+1] = M - 2 |x|: the tent map, which passes through half of all odd numbers below the prime
M before it repeats, for 2 is a primitive root of M.

Regime: the start lasts while the start circuit carries current, |i[k]| + |i[k-1]| above threshold I; when the
centrifugal switch has opened it has ended, and `starting` falls. No time is preset. The capacitor is low where n is so
high that C is below `flag_below` times its rated value.

Inputs, in order: voltage, auxiliary current, speed. Outputs, in order: natural frequency, its half width, damping
ratio. All are limited to the ranges of their signals.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import casadi as ca

from firmloop.design.design import Design, Kind, Request
from firmloop.design.law import DesignError, Flag, Law, Scalar
from firmloop.design.linear.linear_law import check_names, symbols
from firmloop.design.table import check_keys, positive, real
from firmloop.identify.signal import Signal

KEYS = (
    *("frequency_hz", "voltage_rms_V", "resistance_ohm", "inductance_H", "capacitance_F"),
    *("speed_limit_rad_s", "settle_s", "flag_below", "threshold"),
)
PRIME = 1_048_573  # the largest below 2^20 of which 2 is a primitive root
SEED = 648_053.0  # odd, PRIME over the golden ratio: far from what repeats early
SLOWER = 4.0  # the mean distance follows that much more slowly than the estimates
STUDENT = 2.2621571628540993  # half width of 95 % over the deviation, of 2 SLOWER + 1 distances
HALF_WIDTH = STUDENT * math.sqrt(math.pi / 2)  # over the mean distance of a normal variable
INPUT_UNITS = ("V", "A", "rad/s")
OUTPUT_UNITS = ("rad/s", "rad/s", "1")


@dataclass(frozen=True, slots=True)
class Circuit:
    """The auxiliary branch at standstill and how it is watched."""

    omega: float  # rad/s, mains
    inductance: float  # H
    capacitance: float  # F, rated
    damping: float  # of the rated circuit
    natural: float  # rad/s, of the rated circuit
    current: float  # A, amplitude at rated voltage
    limit: float  # rad/s of the shaft
    settle: float  # s
    flag: float  # share of the rated capacitance
    threshold: float  # share of `current`


def design(request: Request) -> Design:
    """Read the circuit and write the law."""
    check_keys(request.table, KEYS, "a start_monitor")
    _check_wires(request)
    circuit = _circuit(request)
    law = _write(request, circuit)
    figures = {
        "natural_frequency_rad_s": circuit.natural,
        "damping_ratio": circuit.damping,
        "current_A": circuit.current,
        "flag_above_rad_s": circuit.natural / math.sqrt(circuit.flag),
    }
    return Design(law, figures, None, {})


def _check_wires(request: Request) -> None:
    units = tuple(wire.unit for wire in request.inputs), tuple(wire.unit for wire in request.outputs)
    if units != (INPUT_UNITS, OUTPUT_UNITS):
        raise DesignError(
            f"controller.kind = 'start_monitor' has inputs in ({', '.join(units[0])}) and outputs in "
            f"({', '.join(units[1])}); it needs voltage, auxiliary current and speed in ({', '.join(INPUT_UNITS)}), "
            "and natural frequency, its half width and damping ratio in "
            f"({', '.join(OUTPUT_UNITS)}): correct [signals] or controller.outputs"
        )


def _circuit(request: Request) -> Circuit:
    table = request.table
    omega = 2 * math.pi * positive(table, "frequency_hz", 60.0)
    if omega * request.period >= 1.0:
        raise DesignError(
            f"controller.period_s = {request.period:g} is too slow for mains of {omega / 2 / math.pi:g} Hz; a "
            f"quadrature needs at least 7 samples a period: at most {1 / omega:.2g} s"
        )
    resistance, inductance = positive(table, "resistance_ohm", None), positive(table, "inductance_H", None)
    capacitance = positive(table, "capacitance_F", None)
    impedance = math.hypot(resistance, omega * inductance - 1 / (omega * capacitance))
    natural = 1 / math.sqrt(inductance * capacitance)
    found = Circuit(
        omega=omega,
        inductance=inductance,
        capacitance=capacitance,
        damping=resistance / 2 * math.sqrt(capacitance / inductance),
        natural=natural,
        current=math.sqrt(2) * positive(table, "voltage_rms_V", None) / impedance,
        limit=positive(table, "speed_limit_rad_s", None),
        settle=positive(table, "settle_s", 0.012),
        flag=real(table, "flag_below", 0.95, 0.5, 0.999),
        threshold=real(table, "threshold", 0.3, 0.01, 0.9),
    )
    if found.settle < 5 * request.period:
        raise DesignError(
            f"controller.settle_s = {found.settle:g} is below five periods of {request.period:g} s; least mean squares "
            "would follow the noise: give more"
        )
    width = request.outputs[1]
    if not width.low <= 0 < width.high:
        raise DesignError(f"signals.{width.name} ranges from {width.low:g} to {width.high:g}; a half width starts at 0")
    rated = (found.natural, None, found.damping)
    for wire, value in zip(request.outputs, rated, strict=True):
        if value is not None and not (0 < wire.low < value < wire.high):
            raise DesignError(
                f"signals.{wire.name} ranges from {wire.low:g} to {wire.high:g}, but the rated circuit has {value:.6g}"
                "; the range must hold it, and be above 0"
            )
    if not found.natural / math.sqrt(found.flag) < request.outputs[0].high:
        raise DesignError(
            f"signals.{request.outputs[0].name}.high = {request.outputs[0].high:g} is reached before the capacitor has "
            f"fallen to {found.flag:g} of its rated value; "
            f"give at least {1.1 * found.natural / math.sqrt(found.flag):.4g}"
        )
    return found


def _write(request: Request, circuit: Circuit) -> Law:
    """Write the equations of the module docstring, with w j for j."""
    h, omega, inductance = request.period, circuit.omega, circuit.inductance
    frequency, width, damping = request.outputs
    names = ("n", "z", "current_last", "twin", "spread", "draw")
    n, z, last, twin, spread, draw = symbols(names)
    v, i, speed = symbols([wire.name for wire in request.inputs])

    slow = speed < circuit.limit
    rate = h / (circuit.settle * inductance * circuit.natural * circuit.current**2)
    scale = omega / math.sin(omega * h)
    quarter = (math.cos(omega * h) * scale) * i - scale * last
    residual = v - inductance * quarter + (inductance / omega**2) * (n * (n * quarter - (2 * omega**2) * (z * i)))
    push = ca.if_else(slow, rate * residual, 0)
    step = push * quarter
    n_next = _within(n - step, frequency)
    z_next = _within(z + push * i, damping)

    forget = h / circuit.settle
    twin_next = (1 - forget) * twin + ca.if_else(draw < 0, -step, step)
    change = (HALF_WIDTH * forget / SLOWER) * ca.fabs(twin) - (forget / SLOWER) * spread
    spread_next = _within(spread + ca.if_else(slow, change, 0), width)

    starting = circuit.threshold * circuit.current < ca.fabs(i) + ca.fabs(last)
    low = n_next > circuit.natural / math.sqrt(circuit.flag)

    check_names(request, [*names, "residual"])
    nexts = (n_next, z_next, i, twin_next, spread_next, PRIME - 2 * ca.fabs(draw))
    stage = ca.Function(
        "law",
        [ca.vertcat(n, z, last, twin, spread, draw), ca.vertcat(v, i, speed)],
        [
            ca.densify(ca.vertcat(*part))
            for part in (nexts, (n_next, spread_next, z_next), (starting, low), (residual,))
        ],
        ["x", "z"],
        ["x_next", "u", "flags", "named"],
    )
    far = _farthest(request, circuit, scale, rate)
    ranges: Mapping[str, tuple[Signal, float, str]] = {
        "n": (frequency, circuit.natural, "limited to the range of its output"),
        "z": (damping, circuit.damping, "limited to the range of its output"),
        "current_last": (request.inputs[1], 0.0, "the current of the sample before"),
        "twin": (Signal("", "rad/s", -far, far), 0.0, "at most the largest step over the share forgotten a sample"),
        "spread": (width, 0.0, "limited to the range of its output"),
        "draw": (Signal("", "1", -float(PRIME), float(PRIME)), SEED, "the tent map leads from this range into it"),
    }
    return Law(
        name=request.name,
        says=f"start monitor: {circuit.natural:.6g} rad/s, damping {circuit.damping:.4g}, "
        f"capacitor low below {circuit.flag:g} of {circuit.capacitance:g} F",
        period=h,
        inputs=request.inputs,
        outputs=request.outputs,
        state=tuple(Signal(name, wire.unit, wire.low, wire.high) for name, (wire, _, _) in ranges.items()),
        start=tuple(start for _, start, _ in ranges.values()),
        why=tuple(why for _, _, why in ranges.values()),
        flags=(
            Flag("starting", "the start circuit carries current"),
            Flag("capacitor_low", "the start capacitor has lost more than it may"),
        ),
        stages=(Scalar(stage, (Signal("residual", "V", -math.inf, math.inf),)),),
    )


def _farthest(request: Request, circuit: Circuit, scale: float, rate: float) -> float:
    """Bound the twin: |d+| <= (1 - f) |d| + S, hence |d| <= S/f, f the share forgotten, S the largest step."""
    omega, inductance, forget = circuit.omega, circuit.inductance, request.period / circuit.settle
    volts, amperes, _ = (max(abs(wire.low), abs(wire.high)) for wire in request.inputs)
    quarter = 2 * scale * amperes
    n, z = request.outputs[0].high, request.outputs[2].high
    residual = volts + inductance * (1 + (n / omega) ** 2) * quarter + 2 * inductance * n * z * amperes
    return 1.01 * rate * residual * quarter / forget


def _within(value: ca.SX, wire: Signal) -> ca.SX:
    return ca.fmin(ca.fmax(value, wire.low), wire.high)


KIND = Kind(
    name="start_monitor",
    says="damping, natural frequency, capacitor and regime of a capacitor-start motor, on line",
    design=design,
    example=Request(
        name="motor_start",
        table={
            "voltage_rms_V": 115.0,
            "resistance_ohm": 4.0,
            "inductance_H": 10.0e-3,
            "capacitance_F": 340e-6,
            "speed_limit_rad_s": 38.0,
        },
        period=0.001,
        inputs=(
            Signal("voltage", "V", -200.0, 200.0),
            Signal("aux_current", "A", -60.0, 60.0),
            Signal("speed", "rad/s", -20.0, 220.0),
        ),
        outputs=(
            Signal("natural_frequency", "rad/s", 400.0, 800.0),
            Signal("half_width", "rad/s", 0.0, 100.0),
            Signal("damping_ratio", "1", 0.05, 1.0),
        ),
        plant=None,
    ),
)

r"""Self-tuning PI: recursive least squares learn a first-order plant as it runs, its poles are placed every sample.

In shares of the ranges, y/Y and u/U, with Y and U the largest magnitudes of measurement and output, the plant is
y[k] = a y[k-1] + b u[k-1]. With t = (a, b), f = (y[k-1], u[k-1]) and l the forgetting factor (Astrom and Wittenmark,
Adaptive Control, 2nd ed., algorithm 3.2 with the indirect self-tuner of section 3.3)::

    d = l + f' P f,     g = P f / d,     t += g (y[k] - f' t),     P = (P - g (P f)') (1/l where trace P < T, else 1)
    kp = (1 + a - 2 p) c,     ki = (1 - p)^2 c,     c = 1/b
    v = I - kp y,     u = min(max(v, u_min), u_max),     I[k+1] = I + ki (r - y) + (1 - p) (u - v)

which puts both poles of the loop at p = exp(-h/time_constant_s). P does not grow where nothing is learned: above the
trace T it is not divided by l. a stays within 0 and 1, b within `spread` times and one `spread`-th of its start.

There is no division: 1/d is a few of Newton's steps x (2 - d x) from the best straight line, right to 1e-10, in
Goldschmidt's form, x (1 + r) and then r = r^2 for r = 1 - d x, which passes no rounding back to d; and c takes one of
Newton's steps a sample, c[k+1] = c (2 - b c), which follows b because b moves slowly.

Keys: `gain` and `lag_s` (the plant as it is first taken to be), `time_constant_s` (of the loop), `forget` (default
0.995), `spread` (default 4), `start_covariance` (default 0.5, a deviation of 0.7 of an a within 0 and 1; most 2; T is
twice that), `u_min`, `u_max`.
"""

from __future__ import annotations

import math
from dataclasses import replace

import casadi as ca

from firmloop.design.design import Design, Kind, Request
from firmloop.design.law import DesignError
from firmloop.design.linear.linear_law import check_names, symbols, write
from firmloop.design.linear.sectioned_law import one_output
from firmloop.design.roles import reference_and_measurement
from firmloop.design.table import check_keys, limits, positive, real
from firmloop.identify.signal import Signal

KEYS = ("gain", "lag_s", "time_constant_s", "forget", "spread", "start_covariance", "u_min", "u_max")
RIGHT = 1e-10  # of the reciprocal, relative
NAMES = ("a", "b", "inverse", "p11", "p12", "p22", "y_last", "u_last", "integral")
HELD_WHY = "limited to what it can be in exact arithmetic"
ROOM = 1.05  # of the covariance, for one sample beyond its trace


def design(request: Request) -> Design:
    """Read the first guess, and write the law."""
    table, h = request.table, request.period
    check_keys(table, KEYS, "a self_tuning")
    output = one_output(request)
    at_reference, at_measurement = reference_and_measurement(request.inputs)
    measurement = request.inputs[at_measurement]
    (low,), (high,) = limits(table, request.outputs)
    if not low < 0 < high:
        raise DesignError(f"controller.u_min = {low:g} and u_max = {high:g}: a self_tuning needs 0 between them")
    wide, strong = max(abs(measurement.low), abs(measurement.high)), max(abs(low), abs(high))
    forget = real(table, "forget", 0.995, 0.9, 1.0)
    spread, size = real(table, "spread", 4.0, 1.01, 1e3), real(table, "start_covariance", 0.5, 1e-3, 2.0)
    a0 = math.exp(-h / positive(table, "lag_s", None))
    b0 = positive(table, "gain", None) * (1 - a0) * strong / wide
    if not 1e-12 < b0 < 1e12:
        raise DesignError(
            f"controller.gain = {table['gain']:g} and lag_s = {table['lag_s']:g} make the whole output move the "
            f"measurement by {b0:g} of its range in a sample; it must be from 1e-12 to 1e12: correct them, or period_s"
        )
    pole = math.exp(-h / positive(table, "time_constant_s", None))
    ends = b0 / spread, b0 * spread

    inputs = symbols([wire.name for wire in request.inputs])
    y = (1 / wide) * inputs[at_measurement]
    error = (1 / wide) * (inputs[at_reference] - inputs[at_measurement])
    a, b, inverse, p11, p12, p22, y_last, u_last, integral = symbols(NAMES)
    most = 2 * size
    # |P f| is at most the root of P_ii f' P f (Cauchy and Schwarz): a limit that only a rounded P can reach
    top = ROOM * most / forget
    far, widest = _eighths(math.sqrt(2 * ROOM * most * top)), _eighths(forget + 2 * ROOM * most)
    seen = (
        _held(p11 * y_last + p12 * u_last, -far, far),
        _held(p12 * y_last + p22 * u_last, -far, far),
    )
    divisor = _held(forget + (seen[0] * y_last + seen[1] * u_last), forget, widest)
    step = _reciprocal(divisor, forget, widest)
    surprise = y - (a * y_last + b * u_last)
    gain = seen[0] * step, seen[1] * step
    a_next = _held(a + gain[0] * surprise, 0.0, 1.0)
    b_next = _held(b + gain[1] * surprise, *ends)
    grown = 1.0 + ca.if_else(p11 + p22 < most, 1 / forget - 1, 0)
    p11_next = _held((p11 - gain[0] * seen[0]) * grown, 0.0, top)
    p12_next = _held((p12 - gain[0] * seen[1]) * grown, -top, top)
    p22_next = _held((p22 - gain[1] * seen[1]) * grown, 0.0, top)
    inverse_next = _held(inverse * (2.0 - b_next * inverse), 1 / ends[1], 1 / ends[0])

    kp = (1 - 2 * pole + a_next) * inverse_next
    free = integral - kp * y
    limited = ca.fmin(ca.fmax(free, low / strong), high / strong)
    reach = 1 + 2 * (1 - pole) / ends[0]  # v within 1 and kp y at most that beyond it
    after = integral + ((1 - pole) ** 2 * (inverse_next * error) + (1 - pole) * (limited - free))
    named = {"surprise": ("1", surprise), "kp": ("1", kp), "unlimited": ("1", free)}
    check_names(request, [*NAMES, *named])
    nexts = (a_next, b_next, inverse_next, p11_next, p12_next, p22_next, y, limited, _held(after, -reach, reach))
    spans = (
        *((0.0, 1.0), ends, (1 / ends[1], 1 / ends[0]), (0.0, top), (-top, top), (0.0, top)),
        *((measurement.low / wide, measurement.high / wide), (low / strong, high / strong), (-reach, reach)),
    )
    ranges = [(Signal(name, "1", *span), HELD_WHY) for name, span in zip(NAMES, spans, strict=True)]
    says = (
        f"self-tuning PI: poles at {pole:.6g}, forgetting {forget:g}, first guess a {a0:.6g}, b {b0:.6g} of full scale"
    )
    states = list(zip((a, b, inverse, p11, p12, p22, y_last, u_last, integral), nexts, strict=True))
    law = write(request, says, inputs, states, ranges, [(strong * limited, strong * free)], named)
    start = (a0, b0, 1 / b0, size, 0.0, size, 0.0, 0.0, 0.0)
    figures = {"a": a0, "b": b0 * wide / strong, "pole": pole, "forget": forget}
    assert output.low <= low and high <= output.high
    return Design(replace(law, start=start), figures, None)


def _reciprocal(divisor: ca.SX, low: float, high: float) -> ca.SX:
    """Return 1/divisor for low <= divisor <= high; the start is the line whose 1 - d x has the smallest maximum."""
    middle = (high + low) / (high - low)
    most = 1 / (2 * middle**2 - 1)
    scale = 8 * most / (high - low) ** 2  # of Chebyshev's second polynomial, 1 at d = 0
    x = scale * (high + low) - scale * divisor
    left = _held(1.0 - divisor * x, -most, most)
    for turn in range(math.ceil(math.log2(math.log(RIGHT) / math.log(most)))):
        left = left * left if turn else left
        x = x + x * left
    return x


def _eighths(value: float) -> float:
    """Return the next limit that every format holds as it is, so that it adds no rounding."""
    return math.ceil(8 * value) / 8


def _held(value: ca.SX, low: float, high: float) -> ca.SX:
    return ca.fmin(ca.fmax(value, low), high)


KIND = Kind(
    name="self_tuning",
    says="PI whose plant is learned by recursive least squares while it runs",
    design=design,
    example=Request(
        name="mill_speed",
        table={"gain": 30.0, "lag_s": 0.1, "time_constant_s": 0.05, "u_max": 11.0},
        period=0.005,
        inputs=(Signal("reference", "rad/s", -400.0, 400.0), Signal("measurement", "rad/s", -400.0, 400.0)),
        outputs=(Signal("output", "V", -12.0, 12.0),),
        plant=None,
    ),
)

r"""Fuzzy PID: rules on the error and its change set how much of each gain acts.

With h the period, e = r - y and c = e[k] - e[k-1] (0 at the first sample), two linguistic variables with three
triangular sets each, negative, zero and positive, whose memberships always sum to 1::

    P(x) = min(max(x, 0), 1),   N(x) = min(max(-x, 0), 1),   Z(x) = 1 - P(x) - N(x)
    F = sum over i, j of set_i(e / error_width) set_j(c / change_width) rules[i][j]
    v = kp Fp e + I + kd/h Fd c,         u = min(max(v, u_min), u_max)
    I[k+1] = min(max(I + ki h Fi e, u_min), u_max)                           I[0] = 0 or the limit next to it

That is Sugeno's inference with constant consequents (Takagi and Sugeno, 1985) used to schedule gains (Zhao, Tomizuka
and Isaka, Fuzzy gain scheduling of PID controllers, IEEE Trans. SMC 23(5), 1993); the weighted mean needs no division
because the weights sum to 1. Rows of a rule table are the sets of e, columns those of c, negative first.

Keys: `kp`, `ki`, `kd`, `error_width`, `change_width` (unit of the measurement), `kp_rules`, `ki_rules`, `kd_rules`
(3 x 3, factors from 0; the defaults below), `u_min`, `u_max`. With every rule at 1 this is a PID.
"""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np
import numpy.typing as npt

from firmloop.design.design import Design, Kind, Request
from firmloop.design.law import DesignError
from firmloop.design.linear.linear_law import check_names, symbols, write
from firmloop.design.linear.sectioned_law import one_output
from firmloop.design.roles import reference_and_measurement
from firmloop.design.table import check_keys, limits, matrix, positive, real
from firmloop.identify.signal import Signal

Array = npt.NDArray[np.float64]

RULES = {
    "kp": [[1.5, 1.3, 1.0], [1.0, 0.8, 1.0], [1.0, 1.3, 1.5]],  # strong far away, stronger when it still departs
    "ki": [[0.3, 0.5, 0.6], [0.9, 1.2, 0.9], [0.6, 0.5, 0.3]],  # patient far away, where it would only wind up
    "kd": [[0.4, 0.6, 1.4], [1.0, 1.0, 1.0], [1.4, 0.6, 0.4]],  # brakes where the error closes quickly
}
KEYS = ("kp", "ki", "kd", "error_width", "change_width", *(f"{gain}_rules" for gain in RULES), "u_min", "u_max")


def design(request: Request) -> Design:
    """Read gains and rules and write the law."""
    table, h = request.table, request.period
    check_keys(table, KEYS, "a fuzzy_pid")
    output = one_output(request)
    at_reference, at_measurement = reference_and_measurement(request.inputs)
    reference, measurement = request.inputs[at_reference], request.inputs[at_measurement]
    kp, ki, kd = real(table, "kp", None), real(table, "ki", 0.0), real(table, "kd", 0.0)
    if kp == ki == kd == 0:
        raise DesignError("controller.kp, ki and kd are all 0; give at least one gain")
    rules = {gain: _rules(table, gain) for gain in RULES}
    (low,), (high,) = limits(table, request.outputs)

    inputs = symbols([wire.name for wire in request.inputs])
    integral, last, started = symbols(["integral", "error_last", "started"])
    error = inputs[at_reference] - inputs[at_measurement]
    change = ca.if_else(started > 0.5, error - last, 0)
    far = _sets((1 / positive(table, "error_width", None)) * error)
    quick = _sets((1 / positive(table, "change_width", None)) * change)
    terms = []
    if kp:
        terms.append(kp * (_inferred(rules["kp"], far, quick) * error))
    if ki:
        terms.append(integral)
    if kd:
        terms.append((kd / h) * (_inferred(rules["kd"], far, quick) * change))
    free = sum(terms[1:], start=terms[0])
    limited = ca.fmin(ca.fmax(free, low), high)
    states = [(last, error), (started, ca.SX(1))]
    widest = reference.high - measurement.low, reference.low - measurement.high
    ranges = [
        (Signal("error_last", measurement.unit, widest[1], widest[0]), "the difference of two signals in their ranges"),
        (Signal("started", "1", 0.0, 1.0), "0 before the first sample, 1 after it"),
    ]
    if ki:
        after = integral + (ki * h) * (_inferred(rules["ki"], far, quick) * error)
        states.insert(0, (integral, ca.fmin(ca.fmax(after, low), high)))
        ranges.insert(0, (Signal("integral", output.unit, low, high), "limited to u_min and u_max"))
    named = {"error": (measurement.unit, error), "unlimited": (output.unit, free)}
    check_names(request, [*(signal.name for signal, _ in ranges), *named])
    says = f"fuzzy PID: kp {kp:.6g}, ki {ki:.6g}, kd {kd:.6g} times 3 x 3 rules on error and change"
    law = write(request, says, inputs, states, ranges, [(limited, free)], named)
    return Design(law, {"kp": kp, "ki": ki, "kd": kd}, None)


def _rules(table: object, gain: str) -> Array:
    """Read one rule table, 3 x 3, no factor below 0."""
    assert isinstance(table, dict) or hasattr(table, "get")
    key = f"{gain}_rules"
    found = matrix({key: table.get(key, RULES[gain])}, key, 3, 3, "three sets of error and of change")
    if np.any(found < 0):
        raise DesignError(
            f"controller.{key} holds {found.min():g}; a rule is a factor of {gain} and cannot be negative"
        )
    return found


def _sets(x: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Return the memberships of negative and positive."""
    return ca.fmin(ca.fmax(-x, 0.0), 1.0), ca.fmin(ca.fmax(x, 0.0), 1.0)


def _inferred(rules: Array, far: Sequence[ca.SX], quick: Sequence[ca.SX]) -> ca.SX:
    """Return the weighted mean of the rules; Z = 1 - P - N is worked into the differences from the middle."""
    return ca.SX(_mean([_mean([float(rule) for rule in row], quick) for row in rules], far))


def _mean(row: Sequence[ca.SX | float], sets: Sequence[ca.SX]) -> ca.SX | float:
    negative, zero, positive = row
    total = zero
    for rule, membership in zip((negative, positive), sets, strict=True):
        apart = rule - zero
        if not (isinstance(apart, float) and apart == 0.0):
            total = total + membership * apart
    return total


KIND = Kind(
    name="fuzzy_pid",
    says="PID whose gains follow fuzzy rules on the error and its change",
    design=design,
    example=Request(
        name="feed_axis",
        table={"kp": 0.05, "ki": 1.2, "kd": 1e-4, "error_width": 80.0, "change_width": 4.0, "u_max": 11.0},
        period=0.001,
        inputs=(Signal("reference", "rad/s", -400.0, 400.0), Signal("measurement", "rad/s", -400.0, 400.0)),
        outputs=(Signal("output", "V", -12.0, 12.0),),
        plant=None,
    ),
)

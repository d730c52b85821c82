"""Write a transfer function on reference - measurement, or on a single input, as a chain of sections."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

import casadi as ca

from firmloop.design.design import Request
from firmloop.design.discretize.rational import METHODS, Rational, from_s
from firmloop.design.discretize.sections import FORMS, Section, sections
from firmloop.design.discretize.unit_circle import written
from firmloop.design.draft import Draft, Element
from firmloop.design.law import DesignError
from firmloop.design.linear.linear_law import symbols, weighted_sum
from firmloop.design.linear.reach import ON_CIRCLE
from firmloop.design.roles import check_meeting, reference_and_measurement
from firmloop.design.table import choice, positive
from firmloop.identify.signal import Signal

METHOD_KEYS = ("discretize", "prewarp_rad_s")
OUTPUT_KEYS = ("form", "u_min", "u_max")


def sampled(request: Request, numerator: list[float], denominator: list[float], usual: str, warp: float) -> Rational:
    """Sample a function of s by the table's `discretize`; `usual` and `warp` (rad/s) where the table says nothing."""
    method = choice(request.table, "discretize", usual, METHODS)
    prewarp = 0.0
    if method == "prewarp":
        prewarp = positive(request.table, "prewarp_rad_s", warp or None)
        below_nyquist(request, "prewarp_rad_s", prewarp)
    elif "prewarp_rad_s" in request.table:
        raise DesignError(
            f"controller.prewarp_rad_s has no use with discretize = '{method}'; remove it, or use 'prewarp'"
        )
    return from_s(numerator, denominator, request.period, method, prewarp)


def below_nyquist(request: Request, key: str, frequency: float) -> None:
    """Refuse a frequency (rad/s) at or above half the sample rate; it is told in the unit that the key ends in."""
    nyquist = math.pi / request.period
    if frequency >= nyquist:
        in_hertz = key.endswith("_hz")
        unit, half, scale = ("Hz", "1/(2 period_s)", 2 * math.pi) if in_hertz else ("rad/s", "pi/period_s", 1.0)
        raise DesignError(
            f"controller.{key} = {frequency / scale:g} {unit} is not below Nyquist's frequency {half} = "
            f"{nyquist / scale:g} {unit}; sample faster (period_s below {math.pi / frequency:.3g}) or lower it"
        )


def sectioned(request: Request, rational: Rational, says: str, gains: Mapping[str, float]) -> Draft:
    """Split and write."""
    chain = sections(rational, choice(request.table, "form", "auto", FORMS))
    output = one_output(request)
    inputs = symbols([wire.name for wire in request.inputs])
    named: dict[str, tuple[str, ca.SX]] = {}
    if len(inputs) == 1:
        value = inputs[0]
    else:
        at_reference, at_measurement = reference_and_measurement(request.inputs)
        check_meeting(request.inputs[at_reference], request.inputs[at_measurement])
        value = inputs[at_reference] - inputs[at_measurement]
        named["error"] = (request.inputs[at_measurement].unit, value)
    state: list[Element] = []
    if not chain:
        value = weighted_sum([rational.gain], [value])
    for k, section in enumerate(chain, 1):
        value, held = _written(section, k, value, output.unit)
        state += held
        named["unlimited" if k == len(chain) else f"section_{k}"] = (output.unit, value)
    figures = dict(gains)
    for k, section in enumerate(chain, 1):
        figures |= {f"section_{k}_b{j}": factor for j, factor in enumerate(section.b)}
        figures |= {f"section_{k}_a{j}": factor for j, factor in enumerate(section.a, 1)}
    forms = "+".join(section.form for section in chain)
    told = says + _kept_for_ever(rational)
    head = f"{told}; {len(chain)} section{'' if len(chain) == 1 else 's'} ({forms})" if chain else told
    return Draft(head, inputs, tuple(state), (value,), named, figures)


def one_output(request: Request) -> Signal:
    """Return the one output; refuse wires that a single-loop controller has no use for."""
    if len(request.outputs) != 1 or len(request.inputs) not in (1, 2):
        raise DesignError(
            f"this controller has the inputs ({_names(request.inputs)}) and the outputs ({_names(request.outputs)}); "
            "it needs a reference and a measurement, or one input, and one output: correct [signals]"
        )
    units = {wire.unit for wire in request.inputs}
    if len(units) > 1:
        one, other = request.inputs
        raise DesignError(
            f"signals.{one.name} is in '{one.unit}', signals.{other.name} in '{other.unit}'; "
            "one is subtracted from the other: give both the same unit"
        )
    return request.outputs[0]


def _written(section: Section, k: int, e: ca.SX, unit: str) -> tuple[ca.SX, list[Element]]:
    """Return what section `k` puts out for `e`, and its state."""
    held = symbols([f"w{k}_{j}" for j in range(1, len(section.a) + 1)])
    y = weighted_sum([section.b[0], 1.0], [e, held[0]])
    state = []
    for j, symbol in enumerate(held):
        kept = 1.0 if section.form == "delta" else 0.0
        further = held[j + 1] if j + 1 < len(held) else ca.SX(0)
        after = weighted_sum([kept, section.b[j + 1], -section.a[j], 1.0], [symbol, e, y, further])
        state.append(Element(symbol.name(), unit, symbol, after))
    return y, state


def _kept_for_ever(rational: Rational) -> str:
    """Say which poles stand on the unit circle: an integrator is meant so, a filter whose digits were cut is not."""
    poles = 1 + rational.poles
    on = [pole for pole in poles if abs(pole) >= 1 - ON_CIRCLE]
    if not on:
        return ""
    at = ", ".join(dict.fromkeys(written(pole) for pole in on))
    return (
        f"; note: {len(on)} of its {len(poles)} poles on the unit circle, at z = {at}: it keeps for ever what it is "
        "given, as an integrator does; if a filter that forgets was meant, its coefficients have too few digits"
    )


def _names(wires: Iterable[Signal]) -> str:
    return ", ".join(wire.name for wire in wires)

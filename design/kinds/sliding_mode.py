r"""Sliding mode with a boundary layer, for a plant whose input moves the measurement's first derivative.

With h the period, e = r - y and the surface s = e + lambda * integral of e (Slotine and Li, Applied Nonlinear Control,
1991, section 7.1.4 for the integral, 7.2 for the layer)::

    s = e + w[k]
    v = f r + K sat(s / phi),     u = min(max(v, u_min), u_max),     sat(x) = min(max(x, -1), 1)
    w[k+1] = min(max(w + lambda h e, -phi), phi)                     w[0] = 0

Keys: `gain` K (unit of the output), `layer` phi (unit of the measurement; what a switch without layer would make
chatter is linear inside), `integral_rad_s` lambda (0: none), `feedforward` f (output per reference, default 0),
`u_min`, `u_max`. Within phi the integral reaches every output that K can give, so it needs no other limit: in steady
state e = 0 and w = s.
"""

from __future__ import annotations

import math

import casadi as ca

from firmloop.design.design import Design, Kind, Request
from firmloop.design.law import DesignError
from firmloop.design.linear.linear_law import check_names, symbols, weighted_sum, write
from firmloop.design.linear.sectioned_law import one_output
from firmloop.design.roles import reference_and_measurement
from firmloop.design.table import check_keys, limits, positive, real
from firmloop.identify.signal import Signal

KEYS = ("gain", "layer", "integral_rad_s", "feedforward", "u_min", "u_max")


def design(request: Request) -> Design:
    """Read the table and write the law."""
    table = request.table
    check_keys(table, KEYS, "a sliding_mode")
    output = one_output(request)
    at_reference, at_measurement = reference_and_measurement(request.inputs)
    unit = request.inputs[at_measurement].unit
    gain, layer = positive(table, "gain", None), positive(table, "layer", None)
    integral, ahead = real(table, "integral_rad_s", 0.0, 0.0), real(table, "feedforward", 0.0)
    if integral * request.period >= 1:
        raise DesignError(
            f"controller.integral_rad_s = {integral:g} is too fast for period_s = {request.period:g}; "
            f"it must be below {1 / request.period:g}"
        )
    (low,), (high,) = limits(table, request.outputs)
    inputs = symbols([wire.name for wire in request.inputs])
    (held,) = symbols(["surface_integral"])
    error = inputs[at_reference] - inputs[at_measurement]
    surface = error + held if integral else error
    inside = ca.fmin(ca.fmax((1 / layer) * surface, -1.0), 1.0)
    free = weighted_sum([gain, ahead], [inside, inputs[at_reference]])
    limited = ca.fmin(ca.fmax(free, low), high)
    named = {"error": (unit, error), "surface": (unit, surface), "unlimited": (output.unit, free)}
    check_names(request, [held.name(), *named])
    after = ca.fmin(ca.fmax(held + (integral * request.period) * error, -layer), layer)
    states = [(held, after)] if integral else []
    ranges = [(Signal(held.name(), unit, -layer, layer), "limited to the boundary layer")] if integral else []
    says = (
        f"sliding mode: gain {gain:.6g} {output.unit}, boundary layer {layer:.6g} {unit}, integral {integral:.6g} rad/s"
    )
    figures = {"gain": gain, "layer": layer, "integral_rad_s": integral, "slope": gain / layer}
    law = write(request, says, inputs, states, ranges, [(limited, free)], named)
    return Design(law, {name: value for name, value in figures.items() if math.isfinite(value)}, None)


KIND = Kind(
    name="sliding_mode",
    says="sliding mode with a boundary layer and an integral surface",
    design=design,
    example=Request(
        name="pump_speed",
        table={"gain": 9.0, "layer": 12.0, "integral_rad_s": 20.0, "feedforward": 0.02, "u_min": -10.0},
        period=0.001,
        inputs=(Signal("reference", "rad/s", -400.0, 400.0), Signal("measurement", "rad/s", -400.0, 400.0)),
        outputs=(Signal("output", "V", -12.0, 12.0),),
        plant=None,
    ),
)

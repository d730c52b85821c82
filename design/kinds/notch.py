"""Notch: take one frequency out of reference - measurement, or out of a single input.

    C(s) = gain (s^2 + 2 d g w s + w^2) / (s^2 + 2 g w s + w^2),    u = min(max(C e, u_min), u_max)

w is `frequency_rad_s` (or `frequency_hz`), g is `damping` (default 0.5: a stop band about as wide as w), d is `depth`
(default 0: nothing passes at w), the magnitude at w. `discretize` (default "prewarp" at w, so that the notch sits where
it was asked for), `form`, `u_min`, `u_max` as in `transfer_function.py`.
"""

from __future__ import annotations

import math

from firmloop.design.design import Design, Kind, Request
from firmloop.design.draft import Draft
from firmloop.design.law import DesignError
from firmloop.design.linear.linear_law import designed
from firmloop.design.linear.sectioned_law import METHOD_KEYS, OUTPUT_KEYS, below_nyquist, sampled, sectioned
from firmloop.design.table import check_keys, positive, real
from firmloop.identify.signal import Signal

KEYS = ("gain", "frequency_rad_s", "frequency_hz", "damping", "depth", *METHOD_KEYS, *OUTPUT_KEYS)


def design(request: Request) -> Design:
    """Place the notch, sample it, and write the law."""
    return designed(request, draft(request))


def draft(request: Request) -> Draft:
    """Place the notch, sample it, and write the equations."""
    table = request.table
    check_keys(table, KEYS, "a notch")
    if "frequency_hz" in table and "frequency_rad_s" in table:
        raise DesignError("controller.frequency_hz and frequency_rad_s are both given; remove one of the two")
    key = "frequency_hz" if "frequency_hz" in table else "frequency_rad_s"
    w = positive(table, key, None) * (2 * math.pi if key == "frequency_hz" else 1.0)
    below_nyquist(request, key, w)
    gain, damping = real(table, "gain", 1.0), positive(table, "damping", 0.5)
    depth = real(table, "depth", 0.0, 0.0, 1.0)
    if gain == 0:
        raise DesignError("controller.gain = 0 gives an output of 0 for ever; give another gain")
    above = [gain, gain * 2 * depth * damping * w, gain * w * w]
    rational = sampled(request, above, [1.0, 2 * damping * w, w * w], "prewarp", w)
    says = f"notch at {w:.6g} rad/s: damping {damping:.6g}, depth {depth:.6g}, gain {gain:.6g}"
    figures = {"frequency_rad_s": w, "damping": damping, "depth": depth, "gain": gain}
    return sectioned(request, rational, says, figures)


KIND = Kind(
    name="notch",
    says="one frequency taken out",
    design=design,
    draft=draft,
    example=Request(
        name="arm_notch",
        table={"frequency_hz": 85.0, "damping": 0.3, "depth": 0.05, "gain": 2.0},
        period=0.001,
        inputs=(Signal("reference", "rad", -3.2, 3.2), Signal("measurement", "rad", -3.2, 3.2)),
        outputs=(Signal("output", "A", -5.0, 5.0),),
        plant=None,
    ),
)

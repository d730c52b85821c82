"""Lead or lag: one zero and one pole on reference - measurement.

    C(s) = gain (s/zero + 1) / (s/pole + 1),    u = min(max(C e, u_min), u_max)

Keys: `gain`, `zero_rad_s`, `pole_rad_s`, a lead where the zero is below the pole; or `gain`, `frequency_rad_s` and
`phase_deg` (from -89 to 89; at 90 the two would lie infinitely far apart): the pair that shifts the phase by that much
at that frequency, where its magnitude is sqrt(pole/zero) gain (Franklin, Powell and Emami-Naeini, Feedback Control of
Dynamic Systems, 7th ed., section 6.7). `discretize` (default "tustin"), `prewarp_rad_s`, `form`, `u_min`, `u_max` as in
`transfer_function.py`.
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

KEYS = ("gain", "zero_rad_s", "pole_rad_s", "frequency_rad_s", "phase_deg", *METHOD_KEYS, *OUTPUT_KEYS)


def design(request: Request) -> Design:
    """Find zero and pole, sample, and write the law."""
    return designed(request, draft(request))


def draft(request: Request) -> Draft:
    """Find zero and pole, sample, and write the equations."""
    table = request.table
    check_keys(table, KEYS, "a lead_lag")
    gain = real(table, "gain", 1.0)
    if gain == 0:
        raise DesignError("controller.gain = 0 gives an output of 0 for ever; give another gain")
    if "phase_deg" in table or "frequency_rad_s" in table:
        for key in ("zero_rad_s", "pole_rad_s"):
            if key in table:
                raise DesignError(f"controller.{key} is given beside phase_deg and frequency_rad_s; remove it or these")
        frequency = positive(table, "frequency_rad_s", None)
        below_nyquist(request, "frequency_rad_s", frequency)
        phase = math.sin(math.radians(real(table, "phase_deg", None, -89.0, 89.0)))
        ratio = math.sqrt((1 + phase) / (1 - phase))
        zero, pole = frequency / ratio, frequency * ratio
    else:
        zero, pole = positive(table, "zero_rad_s", None), positive(table, "pole_rad_s", None)
    rational = sampled(request, [gain / zero, gain], [1 / pole, 1.0], "tustin", 0.0)
    name = "lead" if zero < pole else "lag"
    says = f"{name}: gain {gain:.6g}, zero {zero:.6g} rad/s, pole {pole:.6g} rad/s"
    return sectioned(request, rational, says, {"gain": gain, "zero_rad_s": zero, "pole_rad_s": pole})


KIND = Kind(
    name="lead_lag",
    says="one zero and one pole, by their frequencies or by the phase they give",
    design=design,
    draft=draft,
    example=Request(
        name="stage_lead",
        table={"gain": 3.0, "frequency_rad_s": 120.0, "phase_deg": 50.0},
        period=0.0005,
        inputs=(Signal("reference", "mm", -50.0, 50.0), Signal("measurement", "mm", -50.0, 50.0)),
        outputs=(Signal("output", "N", -40.0, 40.0),),
        plant=None,
    ),
)

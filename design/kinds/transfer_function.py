"""Transfer function: a rational H(z) or sampled H(s) on reference - measurement, as second-order sections.

    u = min(max(H e, u_min), u_max),    e = r - y, or the one input where there is only one

Keys: `numerator` and `denominator` in falling powers of z or s (`domain = "z"` or "s"); for s `discretize = "tustin"`
(default), "zoh", "matched", "prewarp" (with `prewarp_rad_s`) or "backward", see `rational.py`; `form = "auto"`,
"shift" or "delta", see `sections.py`; `u_min`, `u_max`, by default the output's range. The limit stands behind the
filter: the state goes on as if there were none.

A pole outside the unit circle is an error. One on the circle (an integrator) gives a law whose state has no range,
which only floating point can hold.
"""

from __future__ import annotations

from firmloop.design.design import Design, Kind, Request
from firmloop.design.discretize.rational import from_z
from firmloop.design.draft import Draft
from firmloop.design.law import DesignError
from firmloop.design.linear.linear_law import designed
from firmloop.design.linear.sectioned_law import METHOD_KEYS, OUTPUT_KEYS, sampled, sectioned
from firmloop.design.table import check_keys, choice, numbers
from firmloop.identify.signal import Signal

KEYS = ("numerator", "denominator", "domain", *METHOD_KEYS, *OUTPUT_KEYS)


def design(request: Request) -> Design:
    """Read the coefficients, sample them where they are in s, and write the law."""
    return designed(request, draft(request))


def draft(request: Request) -> Draft:
    """Read the coefficients, sample them where they are in s, and write the equations."""
    table = request.table
    check_keys(table, KEYS, "a transfer_function")
    above, below = list(numbers(table, "numerator", None)), list(numbers(table, "denominator", None))
    domain = choice(table, "domain", "z", ("z", "s"))
    if domain == "z":
        for key in METHOD_KEYS:
            if key in table:
                raise DesignError(f'controller.{key} is for domain = "s", but the domain is "z"; remove one of the two')
        rational = from_z(above, below)
    else:
        rational = sampled(request, above, below, "tustin", 0.0)
    method = (
        "" if domain == "z" else f", {choice(table, 'discretize', 'tustin', (str(table.get('discretize')), 'tustin'))}"
    )
    says = f"transfer function in {domain}{method}: {_polynomial(above, domain)} / ({_polynomial(below, domain)})"
    return sectioned(request, rational, says, {})


def _polynomial(coefficients: list[float], variable: str) -> str:
    """Write a polynomial as one line."""
    order = len(coefficients) - 1
    powers = [f" {variable}^{order - k}" if order - k > 1 else f" {variable}" for k in range(order)] + [""]
    terms = [f"{value:.6g}{power}" for value, power in zip(coefficients, powers, strict=True) if value != 0]
    return " + ".join(terms)


KIND = Kind(
    name="transfer_function",
    says="a transfer function in z or s on reference - measurement, as second-order sections",
    design=design,
    draft=draft,
    example=Request(
        name="position_loop",
        table={
            "numerator": [4e4, 2.4e6, 1.6e7],
            "denominator": [1.0, 480.0, 90400.0, 2.4e6, 2.4e5],
            "domain": "s",
            "discretize": "tustin",
        },
        period=0.001,
        inputs=(Signal("reference", "rad", -3.2, 3.2), Signal("measurement", "rad", -3.2, 3.2)),
        outputs=(Signal("output", "V", -12.0, 12.0),),
        plant=None,
    ),
)

"""Transfer function: a rational H(z) or sampled H(s) on reference - measurement, as second-order sections.

    u = min(max(H e, u_min), u_max),    e = r - y, or the one input where there is only one

Keys: `numerator` and `denominator` in falling powers of z or s (`domain = "z"` or "s"), or `sections`, rows of b0, b1,
b2, a0, a1, a2 in the same powers, which a filter of high order needs because its expanded polynomial does not hold its
poles; for s `discretize = "tustin"` (default), "zoh", "matched", "prewarp" (with `prewarp_rad_s`) or "backward", see
`rational.py`; `form = "auto"`, "shift" or "delta", see `sections.py`; `u_min`, `u_max`, by default the output's range.
The limit stands behind the filter: the state goes on as if there were none.

A pole outside the unit circle is an error. One on the circle (an integrator) gives a law whose state has no range,
which only floating point can hold: in fixed point an integral needs `kind = "pid"` with `anti_windup`, or
`kind = "state_space"` with `x_min` and `x_max`, which limit it.
"""

from __future__ import annotations

from firmloop.design.design import Design, Kind, Request
from firmloop.design.discretize.rational import CROWDED, Rational, badly_held, from_z, in_series
from firmloop.design.draft import Draft
from firmloop.design.law import DesignError
from firmloop.design.linear.linear_law import check_states, designed
from firmloop.design.linear.sectioned_law import METHOD_KEYS, OUTPUT_KEYS, sampled, sectioned
from firmloop.design.table import check_keys, choice, matrix, numbers
from firmloop.identify.signal import Signal

KEYS = ("numerator", "denominator", "sections", "domain", *METHOD_KEYS, *OUTPUT_KEYS)


def design(request: Request) -> Design:
    """Read the coefficients, sample them where they are in s, and write the law."""
    return designed(request, draft(request))


def draft(request: Request) -> Draft:
    """Read the coefficients, sample them where they are in s, and write the equations."""
    table = request.table
    check_keys(table, KEYS, "a transfer_function")
    if "sections" in table:
        return _chain(request)
    above, below = list(numbers(table, "numerator", None)), list(numbers(table, "denominator", None))
    domain = choice(table, "domain", "z", ("z", "s"))
    check_states(  # before the roots are asked for
        max(len(above), len(below)) - 1,
        "controller.numerator and denominator make",
        "lower it, or split the filter into controllers in series",
    )
    rational = _rational(request, above, below)
    method = (
        "" if domain == "z" else f", {choice(table, 'discretize', 'tustin', (str(table.get('discretize')), 'tustin'))}"
    )
    says = f"transfer function in {domain}{method}: {_polynomial(above, domain)} / ({_polynomial(below, domain)})"
    if domain == "z" and badly_held(below, rational):
        says += f"; note: {CROWDED}"
    return sectioned(request, rational, says, {})


def _chain(request: Request) -> Draft:
    """Read sections, each with roots of its own, which no expanded polynomial has to hold."""
    table = request.table
    for key in ("numerator", "denominator"):
        if key in table:
            raise DesignError(f"controller.{key} is given beside sections; remove it or these")
    rows = matrix(table, "sections", None, 6, "b0, b1, b2, a0, a1, a2 of each row")
    domain = choice(table, "domain", "z", ("z", "s"))
    if domain == "s" and len(rows) > 1 and table.get("discretize") == "zoh":
        raise DesignError(
            "controller.discretize = 'zoh' holds the input of the whole, not of each of its sections; use 'tustin', "
            "'prewarp', 'matched' or 'backward' with controller.sections"
        )
    parts = [_rational(request, *_plain(row[:3].tolist(), row[3:].tolist())) for row in rows]
    says = f"transfer function in {domain} by {len(rows)} given section{'' if len(rows) == 1 else 's'}"
    return sectioned(request, in_series(parts), says, {})


def _plain(above: list[float], below: list[float]) -> tuple[list[float], list[float]]:
    """Cancel what a row of lower order is filled up with, a common factor of the variable."""
    while len(below) > 1 and above[-1] == below[-1] == 0.0:
        above, below = above[:-1], below[:-1]
    return above, below


def _rational(request: Request, above: list[float], below: list[float]) -> Rational:
    """Take coefficients in z as they are, sample those in s."""
    if choice(request.table, "domain", "z", ("z", "s")) == "s":
        return sampled(request, above, below, "tustin", 0.0)
    for key in METHOD_KEYS:
        if key in request.table:
            raise DesignError(
                f'controller.{key} is for a law in s, and controller.domain is "z", as where it is left out: '
                f'write domain = "s" for coefficients in s, or remove {key}'
            )
    return from_z(above, below)


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

"""Turn what a data sheet prints, a number and its unit, into SI: "2.8 mN*m/A", "10600 rpm", "0.203 lb*ft^2"."""

from __future__ import annotations

import math
import re

from firmloop.identify.error import IdentifyError
from firmloop.identify.printed_units import conversion, joined_groups

SMALLEST, LARGEST = 1e-30, 1e30  # an electron's mass in kg is 9e-31, the planet's 6e24


def in_si(text: object, dimension: str, key: str) -> float:
    """Return a quantity in the SI unit of `dimension`, such as "N*m/A"; a bare number is in SI already.

    Raises
    ------
    IdentifyError
        naming `key` where the text is no quantity of that dimension.
    """
    return _bounded(_read(text, dimension, key), text, key)


def _bounded(value: float, text: object, key: str) -> float:
    """Refuse a slip of the exponent, from which powers and quotients leave the numbers of a computer."""
    if value == 0.0 or SMALLEST <= abs(value) <= LARGEST:
        return value
    raise IdentifyError(
        f"{key} is {text!r}; in SI a quantity is 0 or from {SMALLEST:g} to {LARGEST:g}: check its exponent and its unit"
    )


def _read(text: object, dimension: str, key: str) -> float:
    if isinstance(text, int | float) and not isinstance(text, bool) and math.isfinite(text):
        return float(text)
    plain = joined_groups(text.replace("\u2212", "-")) if isinstance(text, str) else ""
    found = re.fullmatch(r"\s*([-+]?[0-9.]+(?:[eE][-+]?[0-9]+)?)\s*(.*?)\s*", plain)
    try:
        value = float(found.group(1)) if found else math.nan
    except ValueError:
        value = math.nan
    if found is None or not math.isfinite(value):
        raise IdentifyError(f'{key} is {text!r}; write a number and its unit, such as "2.8 mN*m/A"')
    if found.group(2).startswith(","):
        raise IdentifyError(f"{key} is {text!r}; write the number with a point and without marks for thousands")
    if beside := re.search(
        r"\u00b1|\+/-|@|\bat\b|\b(?:typ|max|min|nom)\.|^(?:[-\u2010-\u2015~\u2026]|\.\.+|to\b)\s*\d", found.group(2)
    ):
        raise IdentifyError(
            f"{key} is {text!r}; write the number and its unit alone, without what stands from {beside[0]!r} on; how "
            "far printed figures may be off is datasheet.tolerance"
        )
    made = conversion(found.group(2), dimension, key)
    return value * made.factor + made.offset

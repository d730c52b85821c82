"""Refuse numbers, texts and lists of a project beyond any quantity, once, before anything is computed with them."""

from __future__ import annotations

import math
from collections.abc import Iterator

# The planet's mass is 6e24 kg and an electron's 9e-31: what lies beyond is a slip of the exponent.
LARGEST, SMALLEST = 1e30, 1e-30
# A polynomial's coefficient is a product of as many roots as its order: only the range of a double bounds it.
COEFFICIENTS, LARGEST_COEFFICIENT, SMALLEST_COEFFICIENT = ("numerator", "denominator", "sections"), 1e250, 1e-250
WIDEST = 1e12  # of a signal: a counter of 32 bits, a pressure of 10,000 bar in Pa and a clock in Hz are less
LONGEST_TEXT = 4096  # bytes of a text, as many as of a path
LONGEST_NAME = 255  # bytes of a key, or of a file's name: no common file system keeps a longer one
DEEPEST = 16  # tables in one another; a project has four
MOST_ENTRIES = 100_000  # of a list; what is longer belongs in a recording
WIRE_ENDS = ("low", "high")
WRITTEN_BY_FITS = ("ci95",)  # nobody computes with it, and an end of it may be as near to 0 as it comes

STEPS, FEWEST_STEPS, MOST_STEPS = 100_000, 1, 1_000_000_000  # of a verification
SEED, LAST_SEED = 1, 2**63 - 1

Place = tuple[str, ...]


def whole(value: object, low: int, high: int) -> int:
    """Read a whole number from `low` to `high`, of a command's words or a caller's number.

    Raises
    ------
    ValueError
        with the rule.
    """
    text = str(value)
    if not text.isascii() or not text.isdigit() or len(text) > 20 or not low <= int(text) <= high:
        raise ValueError(f"{text[:30]!r} is not a whole number from {low} to {high}")
    return int(text)


def faults(value: object, place: Place) -> Iterator[tuple[Place, str]]:
    """Yield the place of every value of a TOML document that is beyond its extent, with the rule that it breaks."""
    if len(place) > DEEPEST:
        yield place[:1], f"holds tables in one another, more than {DEEPEST} deep; no key of a project lies so deep"
    elif isinstance(value, dict):
        for key, entry in value.items():
            if len(key.encode()) > LONGEST_NAME:
                yield place, f"holds a key of {len(key.encode())} bytes; a name has at most {LONGEST_NAME}"
            elif key not in WRITTEN_BY_FITS:
                yield from faults(entry, (*place, key))
    elif isinstance(value, list):
        if len(value) > MOST_ENTRIES:
            yield place, f"has {len(value):,} entries; at most {MOST_ENTRIES:,} can stand in a project"
        else:
            for entry in value:
                yield from faults(entry, place)
    elif isinstance(value, str):
        if "\0" in value:
            yield place, "holds a null character, which no name and no text has"
        if len(value.encode()) > LONGEST_TEXT:
            yield place, f"has {len(value.encode()):,} bytes; a text has at most {LONGEST_TEXT:,}"
    elif isinstance(value, int | float) and not isinstance(value, bool):
        rule = _number_fault(value, place)
        if rule:
            yield place, rule


def _number_fault(value: float, place: Place) -> str:
    """Say what is wrong with a number; infinite is what has no limit, and each reader knows if that may be."""
    if isinstance(value, int) and not -(2**63) <= value < 2**63:
        return "holds a whole number beyond 64 bits"
    if math.isnan(value):
        return "holds nan, which is no number: measure it, or remove the key"
    if math.isinf(value) or value == 0:
        return ""
    size = abs(value)
    if len(place) == 3 and place[0] == "signals" and place[2] in WIRE_ENDS and size > WIDEST:
        return f"holds {value:g}; a signal reaches at most {WIDEST:g}: give the range that the wire can carry"
    if place[-1] in COEFFICIENTS:
        low, high, what = SMALLEST_COEFFICIENT, LARGEST_COEFFICIENT, "coefficient"
    else:
        low, high, what = SMALLEST, LARGEST, "quantity"
    if not low <= size <= high:
        return f"holds {value:g}; a {what} is 0 or from {low:g} to {high:g}: check its exponent and its unit"
    return ""

"""Say which rules of MISRA C the generated C departs from, and why each departure is right.

The numbers are those of MISRA C:2012; MISRA C:2023, which takes in its amendments, numbers these rules alike.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

EDITIONS = ("MISRA C:2012", "MISRA C:2023")


@dataclass(frozen=True, slots=True)
class Deviation:
    """One rule that the generated C does not follow: its category, and the reason."""

    category: str
    why: str


def deviations() -> Mapping[str, Deviation]:
    """Return every departure by the number of its rule, in their order."""
    return {
        rule: Deviation(category, why)
        for category, rules in (("required", _REQUIRED), ("advisory", _ADVISORY))
        for rule, why in rules.items()
    }


_REQUIRED = {
    "9.3": "an array without a size is as long as its initializers, all of which are given",
    "10.1": "arithmetic right shift of a signed value: asserted at compile time in fl_fixed.h",
    "10.4": "an enumerator that is a size meets a number: both are of type int",
    "10.6": "a truth value (0 or 1) becomes a 32-bit word",
    "10.7": "a shift's count is narrower than what is shifted, and is not converted to it",
    "10.8": "a word is read as the bits of another type, or narrowed where its value is proven to fit",
}
_ADVISORY = {
    "2.3": "the array-size idiom stands for a static assertion, which C99 does not have",
    "2.4": "status bits are an enumeration without a variable of its type",
    "2.5": "macros of the header (program id, period, Q formats) are for the user",
    "8.7": "init, step and the setters are called by the user, from another file",
    "8.9": "a problem's numbers stand before the function that reads them, not inside it",
    "15.5": "a search ends where its answer is known, a step where an input is not finite",
    "18.4": "a pointer goes through a matrix row by row, which an index would multiply for",
    "19.2": "a float's bits are read or written as a word; C99 6.5.2.3 keeps the bytes of a union",
    "20.1": "the sizes of a problem stand before the header that they size",
}

"""What is printed in place of a unit and is none: how a value was taken, capitals that hide which prefix is meant."""

from __future__ import annotations

import re

_DIRECT = re.compile(r"(?i)(v|a|volts?|amps?|amperes?)[ _]?(?:dc|d\.c\.)(?![a-z])")
_TAKEN = r"(?:rms|eff|pp|pk|p-p|ac)(?![a-z])"
_NO_UNITS = (
    (
        re.compile(rf"(?i)(?<![a-z]){_TAKEN}|(?<=[va]){_TAKEN}"),
        "says how a value was taken and not in what; give the unit alone, and the value that is meant: the amplitude "
        "of a sine is 1.41421 times its rms value and half of what lies between its peaks",
    ),
    (
        re.compile(r"(?<![^\W\d_])M[AVHF](?![^\W\d_])"),
        "would be a million, and in capitals mega and milli are one; write a small m, or the number in the plain unit",
    ),
)


def without_direct(unit: str) -> str:
    """Return `unit` without the DC of volts and amperes, "V DC", "Adc", which leaves their value as it is."""
    return _DIRECT.sub(r"\1", unit)


def no_unit(unit: str) -> str:
    """Say what in `unit` is none, and what to write instead; nothing where there is no such mark."""
    for words, cure in _NO_UNITS:
        if found := words.search(unit):
            return f"{found[0]!r} {cure}"
    return ""

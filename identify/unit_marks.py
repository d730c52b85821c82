"""What is printed in a unit and is no symbol: how a value was taken, a fluid that a pressure lifts, hidden prefixes."""

from __future__ import annotations

import re

_DIRECT = re.compile(r"(?i)(v|a|volts?|amps?|amperes?)[ _]?(?:dc|d\.c\.)(?![a-z])")
_LENGTHS = {"mm": 1e-3, "cm": 1e-2, "m": 1.0, "in": 0.0254, "ft": 0.3048}  # m
_WATER = re.compile(
    r"(?i)(?<![^\W\d_])(?:(in|ft|mm|cm|m)\.?\s*(?:of\s+)?(?:H2O|Aq|water)|(in)\.?\s*w\.?\s?[cg]\.?)(?![^\W_])"
)
# Pa; conventional ones (NIST Special Publication 811, appendix B.8): water of 1000 kg/m^3, mercury of 13,595.1 kg/m^3.
COLUMNS = {
    **{f"{name}water": 9806.65 * size for name, size in _LENGTHS.items()},
    **{f"{name}Hg": 133322.387415 * size for name, size in _LENGTHS.items() if name in ("mm", "cm", "in")},
}
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


def without_marks(unit: str) -> str:
    """Return `unit` without the DC of volts and amperes, "V DC", "Adc", which leaves their value as it is.

    A column of water has the name that it has in `COLUMNS`, whether it is printed as "inH2O", "mm Aq" or "in. w.c.".
    """
    return _WATER.sub(lambda found: f"{(found[1] or found[2]).lower()}water", _DIRECT.sub(r"\1", unit))


def no_unit(unit: str) -> str:
    """Say what in `unit` is none, and what to write instead; nothing where there is no such mark."""
    for words, cure in _NO_UNITS:
        if found := words.search(unit):
            return f"{found[0]!r} {cure}"
    return ""

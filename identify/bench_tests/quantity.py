"""Turn what a datasheet prints, a number and its unit, into SI: "2.8 mN*m/A", "10600 rpm", "0.203 lb*ft^2".

Factors are exact by definition (Bureau International des Poids et Mesures, The International System of Units, 9th ed.;
NIST Special Publication 811, appendix B.8): 1 in = 25.4 mm, 1 lb = 0.45359237 kg, g_n = 9.80665 m/s^2.
"""

from __future__ import annotations

import math
import re

from firmloop.identify.error import IdentifyError

POUND, INCH, FOOT, GRAVITY = 0.45359237, 0.0254, 0.3048, 9.80665
HORSEPOWER = 550 * FOOT * POUND * GRAVITY
TURN = 2 * math.pi / 60  # rad/s per rpm

# In a product lb and oz are forces beside a length and masses beside a squared length; `_factor` tells which.
BASE: dict[str, tuple[float, str]] = {
    "V": (1.0, "V"),
    "A": (1.0, "A"),
    "ohm": (1.0, "ohm"),
    "Ohm": (1.0, "ohm"),
    "Ω": (1.0, "ohm"),
    "H": (1.0, "H"),
    "F": (1.0, "F"),
    "N": (1.0, "N"),
    "m": (1.0, "m"),
    "g": (1e-3, "kg"),
    "s": (1.0, "s"),
    "W": (1.0, "W"),
    "Hz": (1.0, "Hz"),
    "K": (1.0, "K"),
    "rad": (1.0, "rad"),
    "rpm": (TURN, "rad/s"),
    "min": (60.0, "s"),
    "hp": (HORSEPOWER, "W"),
    "lb": (POUND, "kg"),
    "oz": (POUND / 16, "kg"),
    "lbf": (POUND * GRAVITY, "N"),
    "ozf": (POUND * GRAVITY / 16, "N"),
    "in": (INCH, "m"),
    "ft": (FOOT, "m"),
    "%": (0.01, "1"),
    "1": (1.0, "1"),
}
PREFIXES = {"k": 1e3, "c": 1e-2, "m": 1e-3, "u": 1e-6, "µ": 1e-6, "n": 1e-9, "M": 1e6, "d": 1e-1}
UNPREFIXED = ("rpm", "min", "hp", "lb", "oz", "lbf", "ozf", "in", "ft", "%", "1", "rad", "K")


def in_si(text: object, dimension: str, key: str) -> float:
    """Return a quantity in the SI unit of `dimension`, such as "N*m/A"; a bare number is in SI already.

    Raises
    ------
    IdentifyError
        naming `key` where the text is no quantity of that dimension.
    """
    if isinstance(text, int | float) and not isinstance(text, bool) and math.isfinite(text):
        return float(text)
    found = re.fullmatch(r"\s*([-+0-9.eE]+)\s*(.*?)\s*", text) if isinstance(text, str) else None
    try:
        value = float(found.group(1)) if found else math.nan
    except ValueError:
        value = math.nan
    if found is None or not math.isfinite(value):
        raise IdentifyError(f'{key} is {text!r}; write a number and its unit, such as "2.8 mN*m/A"')
    factor, made = _compound(found.group(2), key)
    wanted = _compound(dimension, key)[1]
    if made != wanted:
        raise IdentifyError(
            f"{key} is in {found.group(2) or 'no unit'!r}, which is no {dimension}; give it in a unit of that kind"
        )
    return value * factor


def _compound(unit: str, key: str) -> tuple[float, dict[str, int]]:
    """Factor to SI, and the powers of the base units."""
    factor, powers = 1.0, dict[str, int]()
    plain = unit.replace("·", "*").replace("²", "^2").replace("(", "").replace(")", "")
    plain = re.sub(r"(?<=[A-Za-z0-9])\s+(?=[A-Za-z])", "*", plain).replace("-", "*")
    top, *below = plain.split("/")
    for sign, part in ((1, top), (-1, "*".join(below))):
        for word in filter(None, part.split("*")):
            name, _, power = word.strip().partition("^")
            size, base = _factor(name, unit, key)
            exponent = sign * int(power or "1")
            factor *= size**exponent
            for piece, one in _pieces(base).items():
                powers[piece] = powers.get(piece, 0) + exponent * one
    if powers.get("kg") == 1 and powers.get("m") == 1:
        factor *= GRAVITY  # lb*ft and oz*in of a torque are forces times a length
        for piece, one in {"kg": -1, **_pieces("N")}.items():
            powers[piece] = powers.get(piece, 0) + one
    return factor, {name: power for name, power in powers.items() if power}


def _factor(name: str, unit: str, key: str) -> tuple[float, str]:
    if name in BASE:
        return BASE[name]
    if len(name) > 1 and name[0] in PREFIXES and name[1:] == "rpm":
        return PREFIXES[name[0]] * TURN, "rad/s"
    if len(name) > 1 and name[0] in PREFIXES and name[1:] in BASE and name[1:] not in UNPREFIXED:
        size, base = BASE[name[1:]]
        return PREFIXES[name[0]] * size, base
    raise IdentifyError(f"{key}: the unit {unit!r} holds {name!r}, which is unknown; known: {', '.join(BASE)}")


def _pieces(base: str) -> dict[str, int]:
    """Split a base unit; radians count as pure numbers, as in N*m/A = V*s/rad."""
    pieces = {"rad/s": {"s": -1}, "1": {}, "rad": {}, "Hz": {"s": -1}, "ohm": {"V": 1, "A": -1}, "K": {"K": 1}}
    more = {"H": {"V": 1, "s": 1, "A": -1}, "W": {"V": 1, "A": 1}, "F": {"A": 1, "s": 1, "V": -1}}
    # A newton is a volt ampere second per meter: electrical and mechanical power are one.
    more["N"] = {"V": 1, "A": 1, "s": 1, "m": -1}
    more["kg"] = {"kg": 1}
    return {**pieces, **more}.get(base, {base: 1})

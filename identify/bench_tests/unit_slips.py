"""Say which mistake in a unit would explain that a printed figure is so many times too large or too small."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from firmloop.identify.printed_units import FOOT, GRAVITY, INCH, POUND

Slip = tuple[str, str, float]  # what is taken for what, its factor in words, and as a number
_SLIPS: tuple[Slip, ...] = (
    ("rpm and rad/s (rpm/V and rad/s/V)", "60/(2 pi)", 30.0 / math.pi),
    ("turns and rad", "2 pi", 2.0 * math.pi),
    ("deg and rad", "180/pi", 180.0 / math.pi),
    ("deg/s and rpm", "6", 6.0),
    ("minutes and s", "60", 60.0),
    ("a unit and its thousandth, such as V and mV", "1000", 1e3),
    ("a unit and its millionth", "10^6", 1e6),
    ("cm and m, or percent and a share", "100", 1e2),
    ("cm^2 and m^2", "10^4", 1e4),
    ("V/krpm and V/(rad/s), or rpm/(mN*m) and rad/s/(N*m)", "1000 * 2 pi/60", 1e3 * math.pi / 30.0),
    ("peak and rms", "sqrt(2)", math.sqrt(2.0)),
    ("line and phase", "sqrt(3)", math.sqrt(3.0)),
    ("rpm and rad/s, squared", "(60/(2 pi))^2", (30.0 / math.pi) ** 2),
)
_OF: Mapping[str, tuple[Slip, ...]] = {  # by a part of the unit that one of the figures has
    "N*m": (
        ("N*cm (cN*m) and mN*m", "10", 10.0),
        ("kgf and N", "9.807", GRAVITY),
        ("kgf*cm and N*m, or gf*cm and mN*m", "10.2", 1e2 / GRAVITY),
        ("kgf*cm and mN*m", "98.07", 10.0 * GRAVITY),
        ("oz-in and N*m", "141.6", 16.0 / (POUND * GRAVITY * INCH)),
        ("oz-in and mN*m", "7.062", 1e3 / 16.0 * POUND * GRAVITY * INCH),
        ("lb-in and N*m", "8.851", 1.0 / (POUND * GRAVITY * INCH)),
        ("lb-in and mN*m", "113", 1e3 * POUND * GRAVITY * INCH),
        ("lb-ft and N*m", "1.356", POUND * GRAVITY * FOOT),
        ("lb-in and oz-in", "16", 16.0),
        ("lb-ft and lb-in", "12", 12.0),
        ("lb-ft and oz-in", "192", 192.0),
    ),
    "kg*m^2": (
        ("g*cm^2 and kg*m^2", "10^7", 1e7),
        ("oz-in^2 and g*cm^2", "182.9", 1e7 / 16.0 * POUND * INCH**2),
        ("oz-in^2 and kg*m^2", "54670", 16.0 / (POUND * INCH**2)),
        ("oz-in-s^2 and oz-in^2, or lb-in-s^2 and lb-in^2", "386.1", GRAVITY / INCH),
        ("oz-in-s^2 and kg*m^2", "141.6", 16.0 / (POUND * GRAVITY * INCH)),
        ("lb-in^2 and kg*cm^2", "2.926", 1e4 * POUND * INCH**2),
        ("lb-in-s^2 and kg*m^2", "8.851", 1.0 / (POUND * GRAVITY * INCH)),
        ("lb-ft^2 and kg*m^2", "23.73", 1.0 / (POUND * FOOT**2)),
        ("GD^2 and J", "4", 4.0),
    ),
}
_DIGITS = 0.005  # what three printed digits leave open: as near as this a slip is exact, and none besides is named


def unit_slip(ratio: float, tolerance: float, units: Sequence[str] = (), more: Sequence[Slip] = ()) -> str:
    """Return which slip explains `ratio`, wrong over right, within a share `tolerance`; empty where none does.

    `units` are those of the figures that contradict each other, in SI; `more` are slips of the machine at hand.
    """
    if not 0.0 < ratio < math.inf:
        return ""
    special = (slip for part, slips in _OF.items() if any(part in unit for unit in units) for slip in slips)
    fits = sorted(
        (abs(math.log(max(ratio, 1.0 / ratio) / factor)), f"a factor of {said}, as between {pair}")
        for pair, said, factor in (*more, *_SLIPS, *special)
    )
    reach = _DIGITS if fits[0][0] <= _DIGITS else math.log1p(tolerance)
    return " or ".join(said for off, said in fits[:2] if off <= min(reach, math.log1p(tolerance)))

"""Say which mistake in a unit would explain that a printed figure is so many times too large or too small."""

from __future__ import annotations

import math
from collections.abc import Sequence

Slip = tuple[str, str, float]  # what is taken for what, its factor in words, and as a number
_SLIPS: tuple[Slip, ...] = (
    ("rpm and rad/s", "60/(2 pi)", 30.0 / math.pi),
    ("turns and rad", "2 pi", 2.0 * math.pi),
    ("deg and rad", "180/pi", 180.0 / math.pi),
    ("minutes and s", "60", 60.0),
    ("a unit and its thousandth, such as V and mV", "1000", 1e3),
    ("a unit and its millionth", "10^6", 1e6),
    ("cm and m, or percent and a share", "100", 1e2),
    ("cm^2 and m^2", "10^4", 1e4),
    ("V/krpm and V/(rad/s)", "1000 * 2 pi/60", 1e3 * math.pi / 30.0),
    ("kgf and N", "9.807", 9.80665),
    ("kgf*cm and N*m", "10.2", 100.0 / 9.80665),
    ("oz-in and N*m", "141.6", 16.0 / (0.45359237 * 9.80665 * 0.0254)),
    ("lb-in and N*m", "8.851", 1.0 / (0.45359237 * 9.80665 * 0.0254)),
    ("lb-ft and N*m", "1.356", 0.45359237 * 9.80665 * 0.3048),
    ("peak and rms", "sqrt(2)", math.sqrt(2.0)),
    ("line and phase", "sqrt(3)", math.sqrt(3.0)),
    ("rpm and rad/s, squared", "(60/(2 pi))^2", (30.0 / math.pi) ** 2),
)


def unit_slip(ratio: float, tolerance: float, more: Sequence[Slip] = ()) -> str:
    """Return which slip explains `ratio`, wrong over right, within a share `tolerance`; empty where none does.

    `more` are slips of the machine at hand.
    """
    if not 0.0 < ratio < math.inf:
        return ""
    fits = [
        (abs(math.log(max(ratio, 1.0 / ratio) / factor)), f"a factor of {said}, as between {pair}")
        for pair, said, factor in (*more, *_SLIPS)
    ]
    near = sorted(fit for fit in fits if fit[0] <= math.log1p(tolerance))
    return " or ".join(said for _, said in near[:2])

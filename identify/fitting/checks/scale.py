"""A reading that is a fixed factor off what the plant as given does: a unit."""

from __future__ import annotations

import math

import numpy as np

from firmloop.identify.fitting.check import Check
from firmloop.identify.fitting.evidence import Evidence, alike, compared, run_as_given
from firmloop.identify.plants.kinds import free_scale
from firmloop.identify.units import unit_of

_ALIKE = 0.8  # correlation from which a reading follows the plant
_NEAR = 0.3  # natural logarithm: how far off nominal parameters may be where a unit is the reason
_FAR = math.log(5.0)  # factors beyond it are no inaccuracy of nominal parameters
_HUGE = math.log(200.0)  # a factor beyond it is no doubt of nominal values, which need not fit so well either
_NEAR_HUGE = 1.1
_FEWEST_COUNTS = 28.0  # a turn: an encoder of 7 lines, of which it counts the four edges
_PLACEHOLDER = 1.0  # a free gain of exactly this is no claim

FACTORS = {
    "in thousandths of the unit (mA, mV, mm)": 1000.0,
    "in revolutions per minute": 60.0 / (2.0 * math.pi),
    "in degrees": 180.0 / math.pi,
    "per minute": 60.0,
    "in turns": 1.0 / (2.0 * math.pi),
    "in thousands of the unit": 1e-3,
    "in millionths of the unit": 1e6,
}
_TURNING = {  # what only a shaft is read in, and how it is read
    "in revolutions per minute": ("rad/s",),
    "in degrees": ("rad", "rad/s"),
    "in turns": ("rad", "rad/s"),
}
ELECTRIC = ("in thousandths of the unit (mA, mV, mm)", "in thousands of the unit", "in millionths of the unit")


def unit_of_factor(factor: float, near: float, name: str) -> str | None:
    """Return which unit makes a reading `factor` times as large, within a natural logarithm of `near`.

    Of a signal of that name: only a shaft turns, and only what has a time in its unit is counted by the minute.
    """
    unit, found = unit_of(name), [(near, "")]
    for says, known in FACTORS.items():
        if unit in _TURNING.get(says, (unit,)) and (says != "per minute" or unit.endswith("/s")):
            found.append((abs(math.log(factor / known)), says))
    return min(found)[1] or None


def counts_of(name: str, factor: float) -> tuple[str, str]:
    """Return how a reading in rad or rad/s looks that is `factor` times too large, as an encoder counts, and the cure.

    Both are empty for other readings, and for fewer counts a turn than encoders have.
    """
    counts = 2.0 * math.pi * factor
    if unit_of(name) not in ("rad", "rad/s") or counts < _FEWEST_COUNTS:
        return "", ""
    says = f"in counts of an encoder, about {counts:.4g} a turn (4 times its lines)"
    return says, scaled(name, 1.0 / factor)


def scaled(name: str, scale: float) -> str:
    """Say what gives the column of a signal a scale."""
    line = f'{name} = {{ name = "{name}", scale = {scale:.4g} }}'
    return f"write, with the name in the file on the left, in [recordings.rename] {line}"


def look(evidence: Evidence) -> tuple[str, ...]:
    """Compare every output with the plant as given; a black box whose gain is only a start claims nothing."""
    plant = evidence.given
    claimed = free_scale(plant)
    if claimed is not None and claimed.value == _PLACEHOLDER:
        return ()
    factors: dict[str, list[float]] = {}
    for recording in evidence.recordings:
        run = run_as_given(plant, recording)
        if run is None:
            return ()
        for signal, pair in zip(plant.outputs, compared(evidence, recording, run), strict=True):
            correlation, factor = alike(*pair)
            if factor > 0.0 and correlation > (_ALIKE if abs(math.log(factor)) < _HUGE else _ALIKE / 2.0):
                factors.setdefault(signal.name, []).append(factor)
    found = []
    for name, seen in factors.items():
        factor = float(np.median(seen))
        unit = unit_of_factor(factor, _NEAR if abs(math.log(factor)) < _HUGE else _NEAR_HUGE, name)
        if abs(math.log(factor)) < _FAR and (unit is None or abs(math.log(factor)) < 1.5):
            continue
        if claimed is not None and unit is None:
            continue
        counts, scale = counts_of(name, factor)
        named = unit if not counts or _near(factor, name) else None
        doubt = f"it may be {counts}, or a nominal value is wrong" if counts else "a unit or a nominal value is wrong"
        reason = f"it looks {' or '.join(filter(None, (named, counts)))}" if named else doubt
        cure = f"{scale}, or its unit" if counts else "give the column its unit in [recordings.rename]"
        found.append(
            f"{name} is {factor:.4g} times what the plant as given does: {reason}; "
            f"{cure}, or correct [plant.parameters] if the column is right"
        )
    return tuple(found)


def _near(factor: float, name: str) -> bool:
    return unit_of_factor(factor, _NEAR, name) is not None


CHECK = Check("scale", look, ("rest", "drift", "structure", "excitation"), False)

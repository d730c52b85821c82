"""A reading that is a fixed factor off what the plant as given does: a unit."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from firmloop.identify.fitting.check import Check
from firmloop.identify.fitting.evidence import Evidence, alike, compared, runs_as_given
from firmloop.identify.plants.kinds import free_scale
from firmloop.identify.plants.kinds.dc_motor import GEAR
from firmloop.identify.recordings.columns import rename_line
from firmloop.identify.units import unit_of

_ALIKE = 0.8  # correlation from which a reading follows the plant
_NEAR = 0.3  # natural logarithm: how far off nominal parameters may be where a unit is the reason
_SHAFT = 0.5  # and beside the units of a shaft, of which the nearest two are six times apart
_SURE = 0.1  # natural logarithm: nearer to a known unit nothing else is asked
_FAR = math.log(5.0)  # factors beyond it are no inaccuracy of nominal parameters
_HUGE = math.log(200.0)  # a factor beyond it is no doubt of nominal values, which need not fit so well either
_NEAR_HUGE = 1.1
_FEWEST_COUNTS = 28.0  # a turn: an encoder of 7 lines, of which it counts the four edges
_PERCENT = 100.0
_PLACEHOLDER = 1.0  # a free gain of exactly this is no claim

_THOUSANDS = "in thousands of the unit"  # in which less is recorded than in thousandths
FACTORS = {
    "in thousandths of the unit (mA, mV, mm)": 1000.0,
    "in revolutions per minute": 60.0 / (2.0 * math.pi),
    "in thousands of revolutions per minute": 0.06 / (2.0 * math.pi),
    "in degrees": 180.0 / math.pi,
    "per minute": 60.0,
    "in turns": 1.0 / (2.0 * math.pi),
    _THOUSANDS: 1e-3,
    "in millionths of the unit": 1e6,
}
_TURNING = {  # what only a shaft is read in: by the unit it should have, the one that the column has
    "in revolutions per minute": {"rad/s": "rpm"},
    "in thousands of revolutions per minute": {"rad/s": "krpm"},
    "in degrees": {"rad": "deg", "rad/s": "deg/s"},
    "in turns": {"rad": "rev", "rad/s": "rev/s"},
}
ELECTRIC = ("in thousandths of the unit (mA, mV, mm)", _THOUSANDS, "in millionths of the unit")
_OF_A_SHAFT = (*_TURNING, ELECTRIC[0])


def unit_of_factor(factor: float, near: float, name: str) -> str | None:
    """Return which unit makes a reading `factor` times as large, within a natural logarithm of `near`.

    Of a signal of that name: only a shaft turns, and only what has a time in its unit is counted by the minute.
    """
    unit, found = unit_of(name), [(near, "")]
    turns = turning(name)
    for says, known in FACTORS.items():
        if unit in _TURNING.get(says, (unit,)) and (says in _OF_A_SHAFT or not turns):
            if says != "per minute" or unit.endswith("/s"):
                found.append((abs(math.log(factor / known)), says))
    return min(found)[1] or None


def share_of_supply(name: str, most: float, times: float) -> tuple[str, str]:
    """Say that a voltage may be a share of the supply, and the line that makes it `times` as large then.

    `most` is the largest of its numbers, by which a share is one in ones, in percent, or in counts.
    """
    scale = float(f"{times:.2g}")  # about: which voltage it is, is read off the supply
    full = next((each for each in (1.0, _PERCENT) if most <= each), 0.0)
    of_it = {1.0: "its volts", _PERCENT: "a hundredth of its volts"}.get(
        full, "its volts over the count of a full duty"
    )
    about = f", about {scale * full:g} V," if full else ""
    return (
        f"a share of the supply{' in percent' if full == _PERCENT else ''} (the duty of a PWM)",
        f"measure the supply{about} and with {of_it} as the scale {scaled(name, scale)}",
    )


def turning(name: str) -> bool:
    """Tell whether a signal of that name is read off a shaft."""
    return unit_of(name) in ("rad", "rad/s")


def asked_counts(evidence: Evidence, name: str, factor: float) -> str:
    """Ask whether a reading in rad or rad/s that is `factor` times too large is counted by an encoder.

    Empty for other readings, for an angle that is not in whole numbers, and for fewer counts a turn than encoders have.
    How many they are exactly a measured factor does not tell.
    """
    counts = 2.0 * math.pi * factor
    if not turning(name) or counts < _FEWEST_COUNTS:
        return ""
    if unit_of(name) == "rad" and not all(np.all(each.columns[name] % 1.0 == 0.0) for each in evidence.recordings):
        return ""
    return (
        f"is it in counts of an encoder, about {counts:.4g} a turn (4 times its lines)? then give the column, in "
        f"[recordings.rename], the scale {2.0 * math.pi:.10g} / counts, with the exact counts a turn"
    )


def in_unit(name: str, says: str) -> str:
    """Say what reads the column of a signal in the unit of `FACTORS` that it looks in, by its exact factor."""
    unit = _TURNING.get(says, {}).get(unit_of(name), "")
    return _written(rename_line(name, name, unit) if unit else scale_line(name, 1.0 / FACTORS[says]))


def scaled(name: str, scale: float) -> str:
    """Say what gives the column of a signal a scale."""
    return _written(scale_line(name, scale))


def scale_line(name: str, scale: float) -> str:
    """Return the line of [recordings.rename] that gives a column a scale."""
    return f'{name} = {{ name = "{name}", scale = {int(scale) if scale == int(scale) else scale!r} }}'


def _written(line: str) -> str:
    return f"write, with the name in the file on the left, in [recordings.rename] {line}"


def _factors(evidence: Evidence) -> dict[str, dict[str, float]]:
    """Return how many times as large each output is as the plant makes it as given, by recording, where it follows."""
    found: dict[str, dict[str, float]] = {}
    runs = runs_as_given(evidence) or ()
    for recording, run in zip(evidence.recordings, runs, strict=bool(runs)):
        for signal, pair in zip(evidence.given.outputs, compared(evidence, recording, run), strict=True):
            correlation, factor = alike(*pair)
            if factor > 0.0 and correlation > (_ALIKE if abs(math.log(factor)) < _HUGE else _ALIKE / 2.0):
                found.setdefault(signal.name, {})[recording.source] = factor
    return found


def units_apart(evidence: Evidence) -> tuple[str, ...]:
    """Say of each output that is in another unit in some recordings, or driven by an input that is."""
    return tuple(said for name, seen in _factors(evidence).items() if (said := _of_some(name, seen)))


def look(evidence: Evidence) -> tuple[str, ...]:
    """Compare every output with the plant as given; a black box whose gain is only a start claims nothing."""
    plant = evidence.given
    claimed = free_scale(plant)
    if claimed is not None and claimed.value == _PLACEHOLDER:
        return ()
    if apart := units_apart(evidence):
        return apart
    factors = _factors(evidence)
    medians = {name: float(np.median([*seen.values()])) for name, seen in factors.items()}
    if said := _of_the_drive(evidence, medians):
        return (said,)
    found = []
    for name, factor in medians.items():
        unit = unit_of_factor(factor, _NEAR if abs(math.log(factor)) < _HUGE else _NEAR_HUGE, name)
        if abs(math.log(factor)) < _FAR and (unit is None or abs(math.log(factor)) < 1.5):
            continue
        if claimed is not None and unit is None:
            continue
        found.append(
            f"{name} is {factor:.4g} times what the plant as given does: "
            + (
                _of_a_start(evidence, name, factor)
                or f"{_looks(evidence, name, factor, unit)}, or correct [plant.parameters] if the column is right"
            )
        )
    return tuple(found)


def _of_some(name: str, seen: Mapping[str, float]) -> str:
    """Say that some recordings have a reading, or what drives it, in another unit than others; blank where none has.

    `seen` is how many times as large it is in each as the plant makes it as given.
    """
    right = min(seen, key=lambda each: abs(math.log(seen[each])))
    times = {each: factor / seen[right] for each, factor in seen.items()}
    off = [each for each, factor in times.items() if abs(math.log(factor)) > _FAR]
    if not off or len({each.rpartition("/")[2] for each in seen}) < len(seen):
        return ""
    factor = float(np.median([times[each] for each in off]))
    unit = unit_of_factor(factor, _SHAFT if turning(name) else _NEAR, name)
    return (
        f"{name} is {factor:.3g} times as large in {', '.join(off)} as in {right}, each beside what the plant as given "
        f"does{f': it looks {unit}' if unit else ''}; if so, call the column otherwise in the header of "
        f"{'that file' if len(off) == 1 else 'those files'}, and give that name its unit or scale in "
        "[recordings.rename]; if it is what drives the plant that differs, do so with its column"
    )


def _of_the_drive(evidence: Evidence, factors: Mapping[str, float]) -> str:
    """Say that the input is in another unit, where all readings of a plant are off by about the same factor.

    Empty where they are not, and where no unit of the input explains it.
    """
    plant, logs = evidence.given, [math.log(factor) for factor in factors.values()]
    if len(plant.inputs) > 1 or len(logs) < max(2, len(plant.outputs)) or max(logs) - min(logs) > 2.0 * _NEAR:
        return ""
    factor, drive = math.exp(float(np.mean(logs))), plant.inputs[0].name
    most = max(float(np.max(np.abs(each.columns[drive]))) for each in evidence.recordings)
    pushed = unit_of_factor(1.0 / factor, _SHAFT, drive)
    if pushed:
        cure = f"{drive} looks {pushed}: {in_unit(drive, pushed)}"
    elif unit_of(drive) == "V" and abs(math.log(factor)) > _FAR and (most <= 1.0 or factor < 1.0):
        says, line = share_of_supply(drive, most, factor)
        cure = f"is {drive}, which never goes beyond {most:.3g}, {says}? then {line}"
    else:
        return ""
    return (
        f"{' and '.join(factors)} are all about {factor:.3g} times what the plant as given does, which speaks for the "
        f"input: {cure}; or correct [plant.parameters] if the column is right"
    )


def _of_a_start(evidence: Evidence, name: str, factor: float) -> str:
    """Name the voltage constant of a motor where it is given as wrong by the factor, and fits as its torque constant.

    Where it comes out as given, what is named is the value that does so least. Empty elsewhere. The two are one
    constant in SI units; of a speed in another unit they would not be, and the first would be off by its factor.
    """
    if evidence.fit is None or not turning(name):
        return ""
    if other := _off_beside_its_constant(evidence):
        return other
    given, found = (
        {parameter.name: parameter.value for parameter in plant.parameters}.get("ke_V_s_rad", 0.0)
        for plant in (evidence.given, evidence.fit.plant)
    )
    torque = {parameter.name: parameter.value for parameter in evidence.fit.plant.parameters}.get("kt_N_m_A", 0.0)
    if min(given, found, torque) <= 0.0 or abs(math.log(found / torque)) > _NEAR:
        return ""
    if abs(math.log(given / found / factor)) > _NEAR:
        return ""
    return (
        f"its unit is right, for ke_V_s_rad comes out as {found:.3g}, and kt_N_m_A, which is the same in SI units, is "
        f"{torque:.3g}; correct ke_V_s_rad in [plant.parameters], which is given as {given:.3g}"
    )


def _off_beside_its_constant(evidence: Evidence) -> str:
    """Name the value of a motor that is farthest off where the recordings tell its voltage constant as given."""
    assert evidence.fit is not None
    given = {parameter.name: parameter.value for parameter in evidence.given.parameters}
    found = {each.name: each for each in evidence.fit.plant.parameters if each.name in evidence.fit.free}
    constant = found.get("ke_V_s_rad")
    if constant is None or constant.deviation is None or min(given["ke_V_s_rad"], constant.value) <= 0.0:
        return ""
    if abs(math.log(constant.value / given["ke_V_s_rad"])) > _NEAR or constant.deviation > _SURE * constant.value:
        return ""
    moved = {name: math.log(p.value / given[name]) for name, p in found.items() if min(p.value, given[name]) > 0.0}
    worst = max(moved, key=lambda each: abs(moved[each]))
    if abs(moved[worst]) < _FAR:
        return ""
    return (
        f"its unit is right, for ke_V_s_rad comes out as {constant.value:.3g} and is given as "
        f"{given['ke_V_s_rad']:.3g}; check in [plant.parameters] {worst} and its unit, which is given as "
        f"{given[worst]:.3g} and comes out as {found[worst].value:.3g}"
    )


def _asked_share(evidence: Evidence, drive: str, most: float, factor: float) -> str:
    """Ask whether a voltage that never goes beyond 1 is a duty, where as many volts a unit are no other unit of it."""
    if unit_of(drive) != "V" or len(evidence.given.inputs) > 1 or not most <= 1.0 < factor:
        return ""
    if unit_of_factor(1.0 / factor, _NEAR, drive):
        return ""
    says, cure = share_of_supply(drive, most, factor)
    return f"is {drive}, which never goes beyond 1, {says}? then {cure}"


def _looks(evidence: Evidence, name: str, factor: float, unit: str | None) -> str:
    """Say in which unit a reading looks that is so many times too large, with the line that mends it."""
    drive = evidence.given.inputs[0].name
    most = max(float(np.max(np.abs(each.columns[drive]))) for each in evidence.recordings)
    if turning(name):
        unit = unit_of_factor(factor, _SHAFT, name)
    share = _asked_share(evidence, drive, most, factor)
    if share and not unit:
        return f"{share}; else give {name} its unit there"
    counts = share if share or (unit and unit_of_factor(factor, _SURE, name)) else asked_counts(evidence, name, factor)
    geared = ""
    if turning(name) and factor < 1.0 and "ke_V_s_rad" in {each.name for each in evidence.given.parameters}:
        ratio = f"{GEAR} = {{ value = {1.0 / factor:.3g}, free = false }}"
        geared = f"is it read behind a gear? then write {ratio}, with its exact ratio, in [plant.parameters]"
    alone = len(evidence.given.outputs) == len(evidence.given.inputs) == 1
    if unit == _THOUSANDS and alone and (pushed := unit_of_factor(1.0 / factor, _NEAR, drive)):
        return f"{drive} looks {pushed}: {in_unit(drive, pushed)}; or {name} looks {unit}: {in_unit(name, unit)}"
    if unit:
        other = counts or ("" if unit_of_factor(factor, _SURE, name) else geared)
        return f"it looks {unit}: {in_unit(name, unit)}" + (f"; or {other}" if other else "")
    if counts:
        return f"{counts}; else give it its unit there"
    pushed = unit_of_factor(1.0 / factor, _SHAFT, drive) if factor < 1.0 and len(evidence.given.inputs) == 1 else None
    if pushed:
        return f"{drive} looks {pushed}: {in_unit(drive, pushed)}; else give the column its unit there"
    geared = f"{geared}; else " if geared else ""
    return f"a unit or a nominal value is wrong; {geared}give the column its unit in [recordings.rename]"


CHECK = Check("scale", look, ("rest", "drift", "structure", "excitation"), False)

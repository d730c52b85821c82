"""A motor whose ke and kt differ makes or loses power: a gear stands between, or a unit is wrong."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from firmloop.identify.fitting.check import Check
from firmloop.identify.fitting.checks.scale import (
    ELECTRIC,
    FACTORS,
    asked_counts,
    in_unit,
    share_of_supply,
    turning,
    unit_of_factor,
    units_apart,
)
from firmloop.identify.fitting.evidence import Evidence
from firmloop.identify.plants.kinds.dc_motor import GEAR
from firmloop.identify.plants.plant import Parameter

_MOST = 1.5  # times: iron losses and doubtful data sheets stay below
_SURE = 3.0  # deviations
_UNIT = 0.05  # natural logarithm
_NEARLY = 0.2  # and that far off, by what a data sheet's constant may be, a unit is said beside what else there may be
_USUAL = ("in revolutions per minute", "in degrees")  # usual units of a speed, before any encoder
_PRINTED = 0.002  # of a constant, that the digits of a data sheet leave open: as near as this a unit is exact
_ALIKE = 0.5  # of the logarithm of the ratio: what a doubtful nominal resistance may be off besides
_WIDEST = 0.3  # relative deviation of a constant that is known


def look(evidence: Evidence) -> tuple[str, ...]:
    """Compare the two constants as fitted, or as given before a fit."""
    plant = evidence.fit.plant if evidence.fit is not None else evidence.given
    held = {parameter.name: parameter for parameter in plant.parameters}
    ke, kt = held.get("ke_V_s_rad"), held.get("kt_N_m_A")
    if ke is None or kt is None or not {"R_ohm", "b_N_m_s_rad"} <= held.keys():  # as in equations of one's own
        return ()
    if not (_known(ke, evidence) and _known(kt, evidence)):
        return ()
    ratio = ke.value / kt.value
    doubt = math.hypot(*((p.deviation or 0.0) / p.value for p in (ke, kt)))
    if abs(math.log(ratio)) - _SURE * doubt < math.log(_MOST):
        return ()
    if apart := units_apart(evidence):
        return apart
    says = f"ke / kt is {ratio:.4g}, and 1 where no power is lost or made: "
    if other := _of_a_wire(ratio, held, evidence):
        return (f"{says}{other}",)
    if kt.free and not ke.free:
        return ()  # kt takes what the voltages leave of a wrong speed, too: the plant as given tells more
    times, gear = _read(held), held[GEAR].value if GEAR in held else 1.0
    speed = next((each.name for each in plant.outputs if turning(each.name)), "")
    column, unit = speed, unit_of_factor(times, _NEARLY, speed) if speed else None
    if unit is None and times < 1.0 and not held["R_ohm"].free:  # a voltage so many times too large shows no less
        column = plant.inputs[0].name
        unit = unit_of_factor(1.0 / times, _NEARLY, column)
    counts = asked_counts(evidence, speed, times)
    return (f"{says}{_of_a_column(column, unit, times, doubt, gear, counts)}",)


def _read(held: Mapping[str, Parameter]) -> float:
    """Return how many times too large a speed is read that leaves such constants, once friction is reckoned with.

    What is free follows the speed: beside a given inertia both constants do. A friction b that is given does not: at
    rest u = (ke + R b / kt) w is measured, and ke takes the whole difference.
    """
    ke, kt, friction = (held[name] for name in ("ke_V_s_rad", "kt_N_m_A", "b_N_m_s_rad"))
    if kt.free:
        return math.sqrt(kt.value / ke.value)
    drag = held["R_ohm"].value * friction.value / kt.value if ke.free and not friction.free else 0.0
    return (kt.value + drag) / (ke.value + drag)


def _of_a_column(name: str, unit: str | None, times: float, doubt: float, gear: float, counts: str) -> str:
    """Say in which unit a column looks beside which a speed reads so many times too large, or ask what else it is."""
    geared = f"write {GEAR} = {{ value = {gear / times:.4g}, free = false }} in [plant.parameters]"
    asked = counts if times > 1.0 else f"is the speed read behind a gear? then {geared}"
    if unit is None:
        asked = asked or f"is the speed read behind a gear? then {geared}"
        return f"{asked}; else correct kt_N_m_A or the unit of the speed or of the current"
    off = abs(abs(math.log(times)) - abs(math.log(FACTORS[unit])))
    sure = off < max(_SURE * doubt, _PRINTED) or (unit in _USUAL and off < _UNIT)
    looks = f"{'the speed' if turning(name) else name} looks {unit}: {in_unit(name, unit)}"
    return looks if sure or not asked else f"{looks}; or {asked}"


def _of_a_wire(ratio: float, held: Mapping[str, Parameter], evidence: Evidence) -> str:
    """Say which of voltage and current is in another unit, where the resistance is off as well; a speed leaves it.

    A voltage makes ke and R so many times as large; a current makes R smaller, and beside a given inertia kt.
    """
    given = {parameter.name: parameter.value for parameter in evidence.given.parameters}.get("R_ohm", 0.0)
    found = held.get("R_ohm")
    if found is None or not found.free or evidence.fit is None or not (given > 0.0 and _known(found, evidence)):
        return ""
    moved, off = math.log(found.value / given), math.log(ratio)
    plant = evidence.fit.plant
    if abs(moved - off) < _ALIKE * abs(off):
        name = plant.inputs[0].name
        return _of_the_voltage(
            ratio, name, max(float(np.abs(each.columns[name]).max()) for each in evidence.recordings)
        )
    current = next((each.name for each in plant.outputs if each.name == "current_A"), "")
    unit = unit_of_factor(ratio, _UNIT, current) if current and held["kt_N_m_A"].free else None
    if unit is not None and abs(moved + off) < _ALIKE * abs(off):
        return f"{current} looks {unit}, for R_ohm is off the other way: {in_unit(current, unit)}"
    return ""


def _of_the_voltage(ratio: float, name: str, most: float) -> str:
    """Say in which unit the voltage looks, or that it may be a share of the supply, with the line that mends it.

    `most` is the largest of its numbers, by which a share is one in ones, in percent, or in counts.
    """
    unit = unit_of_factor(ratio, _UNIT, name)
    if unit in ELECTRIC:
        return f"{name} looks {unit}, for R_ohm is off alike; if so, {in_unit(name, str(unit))}"
    share, cure = share_of_supply(name, most, 1.0 / ratio)
    return f"{name} looks in another unit, or {share}, for R_ohm is off alike; if so, {cure}"


def _known(parameter: Parameter, evidence: Evidence) -> bool:
    """Tell whether a value means something: it is given, or the recordings tell it."""
    if not parameter.value > 0.0:
        return False
    if not parameter.free:
        return True
    if evidence.fit is None or parameter.deviation is None:
        return False
    return parameter.deviation < _WIDEST * parameter.value


CHECK = Check("motor_constants", look, ("scale", "rest"), False)

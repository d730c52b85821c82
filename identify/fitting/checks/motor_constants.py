"""A motor whose ke and kt differ makes or loses power: a gear stands between, or a unit is wrong."""

from __future__ import annotations

import math
from collections.abc import Mapping

from firmloop.identify.fitting.check import Check
from firmloop.identify.fitting.checks.scale import ELECTRIC, counts_of, scaled, unit_of_factor
from firmloop.identify.fitting.evidence import Evidence
from firmloop.identify.plants.kinds.dc_motor import GEAR
from firmloop.identify.plants.plant import Parameter
from firmloop.identify.units import unit_of

_MOST = 1.5  # times: iron losses and doubtful data sheets stay below
_SURE = 3.0  # deviations
_UNIT = 0.05  # natural logarithm
_EXACT = ("in revolutions per minute", "in degrees")  # usual units of a speed, before any encoder
_ALIKE = 0.5  # of the logarithm of the ratio: what a doubtful nominal resistance may be off besides
_WIDEST = 0.3  # relative deviation of a constant that is known


def look(evidence: Evidence) -> tuple[str, ...]:
    """Compare the two constants as fitted, or as given before a fit."""
    plant = evidence.fit.plant if evidence.fit is not None else evidence.given
    held = {parameter.name: parameter for parameter in plant.parameters}
    ke, kt = held.get("ke_V_s_rad"), held.get("kt_N_m_A")
    if ke is None or kt is None or not (_known(ke, evidence) and _known(kt, evidence)):
        return ()
    ratio = ke.value / kt.value
    doubt = math.hypot(*((p.deviation or 0.0) / p.value for p in (ke, kt)))
    if abs(math.log(ratio)) - _SURE * doubt < math.log(_MOST):
        return ()
    factor = math.sqrt(ratio) if kt.free else ratio  # beside a given inertia a slower shaft takes from kt, too
    says = f"ke / kt is {ratio:.4g}, and 1 where no power is lost or made: "
    if _follows(ratio, held, evidence):
        return (f"{says}{_of_the_voltage(ratio, plant.inputs[0].name)}",)
    turning = next((each.name for each in plant.outputs if unit_of(each.name) in ("rad", "rad/s")), "")
    unit = unit_of_factor(1.0 / factor, _UNIT, turning)
    counts, cure = counts_of(turning, 1.0 / factor)
    gear = factor * held[GEAR].value if GEAR in held else factor
    key = f"write {GEAR} = {{ value = {gear:.4g}, free = false }} in [plant.parameters]"
    if unit is not None and unit != "per minute":
        other = f", or {counts}" if counts and unit not in _EXACT else ""
        behind = f"; or it is read behind a gear: {key}" if factor > 1.0 else ""
        return (f"{says}the speed looks {unit}{other}; give the column its unit in [recordings.rename]{behind}",)
    if counts:
        return (f"{says}the speed looks {counts}: {cure}; behind a gear, {key}",)
    return (
        f"{says}the speed may be read behind a gear: {key}, or correct kt_N_m_A or the unit of the speed or of the "
        "current",
    )


def _follows(ratio: float, held: Mapping[str, Parameter], evidence: Evidence) -> bool:
    """Tell whether the resistance is off by as much as ke, as a voltage in another unit leaves both; no gear does."""
    given = {parameter.name: parameter.value for parameter in evidence.given.parameters}.get("R_ohm", 0.0)
    found = held.get("R_ohm")
    if found is None or not found.free or evidence.fit is None or not (given > 0.0 and _known(found, evidence)):
        return False
    moved = math.log(found.value / given)
    return abs(moved - math.log(ratio)) < _ALIKE * abs(math.log(ratio))


def _of_the_voltage(ratio: float, name: str) -> str:
    """Say in which unit the voltage looks, or that it may be a share of the supply, with the line that mends it."""
    unit = unit_of_factor(ratio, _UNIT, name)
    looks = unit if unit in ELECTRIC else "in another unit, or a share of the supply (the duty of a PWM)"
    return f"{name} looks {looks}, for R_ohm is off alike; if so, {scaled(name, 1.0 / ratio)}"


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

"""A motor whose ke and kt differ makes or loses power: a gear stands between, or a unit is wrong."""

from __future__ import annotations

import math

from firmloop.identify.fitting.check import Check
from firmloop.identify.fitting.checks.scale import unit_of_factor
from firmloop.identify.fitting.evidence import Evidence
from firmloop.identify.plants.kinds.dc_motor import GEAR
from firmloop.identify.plants.plant import Parameter

_MOST = 1.5  # times: iron losses and doubtful data sheets stay below
_SURE = 3.0  # deviations
_UNIT = 0.05  # natural logarithm
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
    unit = unit_of_factor(1.0 / factor, _UNIT)
    says = f"ke / kt is {ratio:.4g}, and 1 where no power is lost or made: "
    if unit is not None and unit != "per minute":
        return (f"{says}the speed looks {unit}; give the column its unit in [recordings.rename]",)
    gear = factor * held[GEAR].value if GEAR in held else factor
    return (
        f"{says}the speed may be read behind a gear: write {GEAR} = {{ value = {gear:.4g}, free = false }} in "
        "[plant.parameters], or correct kt_N_m_A or the unit of the speed or of the current",
    )


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

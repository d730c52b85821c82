"""Let intervals carry the doubt of a torque constant that was given: in SI units it is the voltage constant.

All torques of a motor are on the scale of the torque constant. Where that is held as given and the voltage constant is
fitted, the logarithm of their ratio is by how much that scale may be off.
"""

from __future__ import annotations

import math

from firmloop.diagnose.model.angle import with_walk
from firmloop.diagnose.model.fit import Fitted, doubted
from firmloop.diagnose.model.hypothesis import Problem
from firmloop.diagnose.model.torque_scale import on_scale_of_torques
from firmloop.diagnose.policy import KNOWN_BY_FACTOR, SAME_CONSTANT
from firmloop.identify.plants.effect import EffectParameter

_TORQUE, _VOLTAGE = "kt_N_m_A", "ke_V_s_rad"


def scale_doubt(problem: Problem, fitted: Fitted) -> float:
    """Return one standard deviation of the logarithm of the torque scale; 0 where nothing tells of it."""
    given = {p.name: p for p in problem.plant.parameters}
    if _TORQUE not in given or _VOLTAGE not in given or given[_TORQUE].free:
        return 0.0
    torque, voltage = given[_TORQUE].value, fitted.point.values.get(_VOLTAGE, given[_VOLTAGE].value)
    if not (torque > 0.0 and voltage > 0.0):
        return 0.0
    apart = abs(math.log(torque / voltage))
    return apart if apart < SAME_CONSTANT else 0.0


def with_doubt_of_given(problem: Problem, fitted: Fitted) -> Fitted:
    """Widen the deviations to what a torque constant as given, and an angle that waves follow, leave of them."""
    return with_scale_doubt(problem, with_walk(problem, fitted))


def with_scale_doubt(problem: Problem, fitted: Fitted) -> Fitted:
    """Widen the deviations of all that is on the scale of torques."""
    doubt = scale_doubt(problem, fitted)
    values = {
        each.name: fitted.point.values[each.name] for each in fitted.coordinates if on_scale_of_torques(each.name)
    }
    return doubted(fitted, {name: doubt * abs(value) for name, value in values.items()})


def interval_of(known: EffectParameter, value: float, reach: float, alone: float) -> tuple[float, float] | None:
    """Return value ± reach, None where it is unknown; as a factor where the parameter was fitted as its logarithm.

    So, too, where only a scale of torques of which little is known would let it be nothing: `alone` is its reach if
    that scale were known.
    """
    by_factor = (known.logarithmic and value > 0.0) or alone < abs(value) <= reach
    if not math.isfinite(reach) or (by_factor and reach > KNOWN_BY_FACTOR * abs(value)):
        return None
    low, high = value - reach, value + reach
    if by_factor:
        factor = math.exp(reach / abs(value))
        low, high = sorted((value / factor, value * factor))
    return min(max(low, known.low), value), max(min(high, known.high), value)

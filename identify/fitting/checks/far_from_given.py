"""A parameter that the recordings tell well, and far from where the project has it: its value or a unit is wrong."""

from __future__ import annotations

import math

from firmloop.identify.fitting.check import Check
from firmloop.identify.fitting.evidence import Evidence
from firmloop.identify.plants.attach import with_effects
from firmloop.identify.plants.kinds import kinds
from firmloop.identify.plants.plant import Parameter

_FAR = math.log(10.0)  # of any parameter: a start may be as far off as that and be meant
_FIRM = 0.1  # of a parameter, as one deviation: it is well determined


def look(evidence: Evidence) -> tuple[str, ...]:
    """Compare what the fit finds with what is given; the own parameters of a black box are only starts."""
    if evidence.fit is None:
        return ()
    given = {parameter.name: parameter.value for parameter in evidence.given.parameters}
    kind = kinds().get(evidence.given.kind)
    starts = {each.name for each in with_effects(evidence.given, ()).parameters} if kind and kind.scale else set()
    far = [
        (each, each.value / given[each.name])
        for each in evidence.fit.plant.parameters
        if each.name in evidence.fit.free and each.name not in starts and _far(each, given[each.name])
    ]
    if not far:
        return ()
    told = ", ".join(
        f"{' '.join(filter(None, (f'{each.name} = {each.value:.3g}', each.unit)))}, {times:.2g} times what the project "
        "gives" + ("" if times > 0.0 else ", and of the other sign")
        for each, times in far
    )
    several = len(far) > 1
    return (
        f"the recordings are met with {told}; check {'these values and their units' if several else 'it and its unit'} "
        "in the project, and the units of the columns",
    )


def _far(found: Parameter, given: float) -> bool:
    """Tell whether a value is well determined and far from what is given; a given 0 or 1 is only a start."""
    if found.deviation is None or found.value == 0.0 or given in (0.0, 1.0) or not math.isfinite(given):
        return False
    return abs(math.log(abs(found.value / given))) > _FAR and found.deviation < _FIRM * abs(found.value)


CHECK = Check(
    "far_from_given",
    look,
    (),
    True,
    silenced_by=(
        "clock_unit",
        "electrical_scale",
        "lost_rows",
        "motor_constants",
        "scale",
        "sign",
        "spikes",
        "swapped",
        "three_phases",
    ),
)

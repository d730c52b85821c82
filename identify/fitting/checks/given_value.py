"""A value that is given and kept, though the recordings deny it: a delay of another rig, a resistance of a data sheet.

What the fit leaves is then no noise, and other parameters are pulled away to make up for it. Each kept value is set
free in turn: where one leaves much less, and nothing that the input explains, that value is the cause.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

from firmloop.identify.fitting.check import Check
from firmloop.identify.fitting.checks import structure
from firmloop.identify.fitting.evidence import Evidence, sources_of
from firmloop.identify.fitting.fit import Fit, tried
from firmloop.identify.fitting.starting_points import unguided
from firmloop.identify.plants.plant import Parameter

_SMALLER = 0.6  # of what the fit leaves of an output: so little is left once the value is free
_NO_LARGER = 1.05  # and of every other output hardly more
_ALIKE = 1.05  # times what the best leaves: values that only act together are all named
_MOST = 6  # values that are tried: each is a fit


def look(evidence: Evidence) -> tuple[str, ...]:
    """Free each kept value where the fit leaves more than noise."""
    kept = [each for each in evidence.given.parameters if not each.free and math.isfinite(each.value)]
    if not kept or len(kept) > _MOST or not structure.look(evidence):
        return ()
    found = {each.name: fit for each in kept if (fit := _freed(evidence, each)) is not None}
    if not found:
        return ()
    left = {name: sum(fit.noise[each] / _left(evidence, each) for each in fit.noise) for name, fit in found.items()}
    alike = [each for each in kept if left.get(each.name, math.inf) <= _ALIKE * min(left.values())]
    return (_told(evidence, alike, found),)


def _left(evidence: Evidence, output: str) -> float:
    assert evidence.fit is not None
    return max(evidence.fit.noise[output], 1e-300)


def _freed(evidence: Evidence, value: Parameter) -> Fit | None:
    """Return the fit with one kept value set free, if that leaves little and nothing that the input explains."""
    plant = evidence.given.freed(value.name)  # what is wrong is no value to begin with
    found = tried(unguided(plant) or plant, evidence.recordings, evidence.conditioning)
    if found is None:
        return None
    shares = [found.noise[output] / _left(evidence, output) for output in found.noise]
    if min(shares) > _SMALLER or max(shares) > _NO_LARGER or structure.look(replace(evidence, fit=found)):
        return None
    # Where the value as given does as well once the others begin anew, the fit went astray for another reason.
    bare = unguided(evidence.given)
    held = None if bare is None else tried(bare, evidence.recordings, evidence.conditioning)
    as_well = held is not None and all(held.noise[each] <= _ALIKE * found.noise[each] for each in found.noise)
    return None if as_well else found


def _told(evidence: Evidence, values: Sequence[Parameter], found: Mapping[str, Fit]) -> str:
    fit = found[values[0].name]
    worst = min(fit.noise, key=lambda output: fit.noise[output] / _left(evidence, output))
    unit = next(each.unit for each in fit.plant.outputs if each.name == worst)
    left = f"{fit.noise[worst]:.3g} instead of {_left(evidence, worst):.3g} {unit}".rstrip()
    asked = {name: next(p.value for p in one.plant.parameters if p.name == name) for name, one in found.items()}
    said = " or ".join(
        f"{each.name} = {asked[each.name]:.4g} in place of {each.value:.4g} {each.unit}".rstrip() for each in values
    )
    lines = " or ".join(
        f"{each.name.rpartition('.')[2]} = {{ value = {asked[each.name]:.4g}, free = true }}" for each in values
    )
    return (
        f"{sources_of(evidence.recordings)} denies a value that is given and kept, and asks for {said}: with that "
        f"{left} rms is left of {worst}, and nothing that the input explains; correct it, or set it free: {lines}"
    )


CHECK = Check(
    "given_value",
    look,
    ("early", "structure", "drift", "excitation", "far_from_given"),
    True,
    silenced_by=(
        "clock_unit",
        "electrical_scale",
        "sign",
        "scale",
        "swapped",
        "wrapped",
        "lost_rows",
        "frozen",
        "spikes",
    ),
)

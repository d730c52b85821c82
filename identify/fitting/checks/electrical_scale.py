"""A machine whose parameters are all off by one factor, as a voltage or current that is logged so many times too large.

Voltages c times too large make R, Ld, Lq, the flux, J and b of a pmsm c times as large and leave all outputs as they
are, currents make R and both L so many times smaller and J and b larger. No output tells, nor does any residual: only
what the project gives.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from firmloop.identify.fitting.check import Check
from firmloop.identify.fitting.checks.scale import ELECTRIC, FACTORS, unit_of_factor
from firmloop.identify.fitting.evidence import Evidence
from firmloop.identify.plants.plant import Plant

_FOLLOWS = {  # powers of the factor by which the parameters follow; friction, which nobody knows, is not asked
    "voltage": {"R_ohm": 1.0, "Ld_H": 1.0, "Lq_H": 1.0, "flux_Wb": 1.0, "J_kg_m2": 1.0},
    "current": {"R_ohm": -1.0, "Ld_H": -1.0, "Lq_H": -1.0, "flux_Wb": 0.0, "J_kg_m2": 1.0},
}
_LEAST = math.log(1.25)  # further off than a data sheet, in all parameters and the same way
_ALIKE = 0.5  # of the factor's logarithm: what each may be off besides
_UNIT = 0.1  # natural logarithm
_TOLD = 0.3  # relative deviation of a parameter that the recordings tell


def look(evidence: Evidence) -> tuple[str, ...]:
    """Compare the parameters as fitted with those given."""
    assert evidence.fit is not None
    told = {
        p.name: p.value
        for p in evidence.fit.plant.parameters
        if p.free and p.deviation is not None and p.deviation < _TOLD * abs(p.value)
    }
    found = off_by(evidence.given, told)
    return (says(evidence.given, *found),) if found is not None else ()


def off_by(given: Plant, found: Mapping[str, float]) -> tuple[str, float] | None:
    """Return what is logged too large, voltage or current, and how many times, by the parameters as `found`.

    None where they are not all told, or not off together.
    """
    known = {p.name: p.value for p in given.parameters if p.free and p.value > 0.0}
    for quantity, powers in _FOLLOWS.items() if given.kind == "pmsm" else ():
        if any(known.get(name, 0.0) <= 0.0 or found.get(name, 0.0) <= 0.0 for name in powers):
            return None
        moved = {name: math.log(found[name] / known[name]) for name in powers}
        size = sum(powers[name] * moved[name] for name in powers) / sum(power**2 for power in powers.values())
        if abs(size) > _LEAST and all(abs(moved[name] - powers[name] * size) < _ALIKE * abs(size) for name in powers):
            return quantity, math.exp(size)
    return None


def says(plant: Plant, quantity: str, factor: float) -> str:
    """Say which columns look off, and the line that mends them."""
    wires = [signal.name for signal in (*plant.inputs, *plant.outputs)]
    names = ["supply_V"] if quantity == "voltage" and "supply_V" in wires else []
    names = names or [name for name in wires if name.startswith(f"{quantity}_")]
    unit = unit_of_factor(factor, _UNIT)
    named = f" ({unit})" if unit in ELECTRIC else ""
    factor = FACTORS[str(unit)] if named else float(f"{factor:.2g}")  # a data sheet knows no more
    lines = " and ".join(f'{name} = {{ name = "{name}", scale = {1.0 / factor:.4g} }}' for name in names)
    follow = " and ".join(
        f"{', '.join(those)} {times:.2g} times"
        for those, times in (
            ([name for name, power in _FOLLOWS[quantity].items() if power > 0.0], factor),
            ([name for name, power in _FOLLOWS[quantity].items() if power < 0.0], 1.0 / factor),
        )
        if those
    )
    looks = "looks" if len(names) == 1 else "look"
    return (
        f"{' and '.join(names)} {looks} about {factor:g} times too large{named}: the recordings "
        f"are met with {follow} what [plant.parameters] gives, all by one factor; write in [recordings.rename], with "
        f"the names in the file on the left, {lines}, or correct all these parameters"
    )


CHECK = Check("electrical_scale", look, ("scale", "rest", "drift", "structure", "excitation"), True)

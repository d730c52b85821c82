"""Read off the equations of an `ode` which derivatives are balances, where the project does not say."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import product

import casadi as ca
import numpy as np

from firmloop.identify.units import unit_of

# The unit of a state: what its derivative is the balance of, and the unit of what stores it.
_STORES = {
    "rad/s": ("torque", "kg*m^2"),
    "m/s": ("force", "kg"),
    "A": ("voltage", "H"),
    "K": ("flow", "J/K"),
    "m": ("flow", "m^2"),
    "V": ("flow", "F"),
}
_PER_AMPERE = {"torque": "N*m/A", "force": "N/A"}
_TRIES = 3  # points at which a derivative is asked


def usual_balances(
    rates: Mapping[str, ca.SX], known: Mapping[str, ca.SX], parameters: Sequence[str]
) -> dict[str, object]:
    """Return the entries of `[plant.balances]` that units tell, such as that of a current by its one inductance.

    `rates` are the derivatives by state, `known` the symbols of all names. A derivative is a balance where it is some
    sum over one parameter of the right unit, and nothing of that sum depends on it.
    """
    return {
        state: entry
        for state, rate in rates.items()
        if unit_of(state) in _STORES and (entry := _entry(state, rate, rates, known, parameters)) is not None
    }


def _entry(
    state: str, rate: ca.SX, rates: Mapping[str, ca.SX], known: Mapping[str, ca.SX], parameters: Sequence[str]
) -> dict[str, str] | None:
    kind, unit = _STORES[unit_of(state)]
    used = [name for name in parameters if ca.depends_on(rate, known[name])]
    stores = [name for name in used if unit_of(name) == unit]
    if len(stores) != 1:
        return None
    total = rate * known[stores[0]]
    if not _vanishes(ca.jacobian(total, known[stores[0]]), known):
        return None
    entry = {"kind": kind, "per": f"1/{stores[0]}"}
    places = [other for other, each in rates.items() if ca.is_equal(each, known[state], 1)]
    if kind in ("torque", "force") and len(places) == 1:
        entry["position"] = places[0]
    constants = [name for name in used if unit_of(name) == _PER_AMPERE.get(kind)]
    drives = [
        (constant, current)
        for constant, current in product(constants, (name for name in rates if unit_of(name) == "A"))
        if _vanishes(ca.jacobian(total, known[current]) - known[constant], known)
    ]
    if len(drives) == 1:
        constant, current = drives[0]
        entry |= {"effort": f"{constant}*{current}", "current": current}
    losses = [name for name in used if unit_of(name) == "ohm"]
    if kind == "voltage" and len(losses) == 1 and _vanishes(ca.jacobian(total, known[losses[0]]) + known[state], known):
        entry["resistance"] = losses[0]
    return entry


def _vanishes(form: ca.SX, known: Mapping[str, ca.SX]) -> bool:
    """Tell whether an expression is zero whatever its names stand for."""
    asked = ca.Function("asked", [ca.vertcat(*known.values())], [form])
    points = np.random.default_rng(0).uniform(0.5, 2.0, (_TRIES, len(known)))
    return all(abs(float(asked(point))) < 1e-9 for point in points)

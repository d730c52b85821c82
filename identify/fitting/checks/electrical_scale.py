"""A machine whose parameters are all off by one factor, as a voltage or current that is logged so many times too large.

Voltages c times too large make R, Ld, Lq, the flux, J and b of a pmsm c times as large and leave all outputs as they
are, currents make R and both L so many times smaller and J and b larger. No output tells, nor does any residual: only
what the project gives. Before a fit the rows tell the parameters, with u, i, w as logged, from row to row (h apart)::

    i_d[k+1] - i_d = h (v_d - R i_d + p w Lq i_q) / Ld      i_q[k+1] - i_q = h (v_q - R i_q - p w (Ld i_d + psi)) / Lq
    w[k+1] - w = h (3/2 p (psi i_q + (Ld - Lq) i_d i_q) - b w - T) / J

A search must not begin beside it: it would take minutes to say so.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from firmloop.identify.fitting.check import Check
from firmloop.identify.fitting.checks.scale import ELECTRIC, FACTORS, scale_line, unit_of_factor
from firmloop.identify.fitting.evidence import Evidence
from firmloop.identify.fitting.least_squares import regressed
from firmloop.identify.plants.plant import Plant
from firmloop.identify.recordings.recording import Recording
from firmloop.identify.recordings.rotor_frame import RotorFrame, rotor_frame

Array = NDArray[np.float64]

_FOLLOWS = {  # powers of the factor by which the parameters follow; friction, which nobody knows, is not asked
    "voltage": {"R_ohm": 1.0, "Ld_H": 1.0, "Lq_H": 1.0, "flux_Wb": 1.0, "J_kg_m2": 1.0},
    "current": {"R_ohm": -1.0, "Ld_H": -1.0, "Lq_H": -1.0, "flux_Wb": 0.0, "J_kg_m2": 1.0},
}
_LEAST = math.log(1.25)  # further off than a data sheet, in all parameters and the same way
_ALIKE = 0.5  # of the factor's logarithm: what each may be off besides
_UNIT = 0.1  # natural logarithm
_TOLD = 0.3  # relative deviation of a parameter that the recordings tell


def look(evidence: Evidence) -> tuple[str, ...]:
    """Compare the parameters as fitted, or before a fit as the rows tell them, with those given."""
    if evidence.given.kind != "pmsm":
        return ()
    if evidence.fit is None:
        told = told_by_rows(evidence.given, evidence.recordings)
    else:
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
    for quantity, powers in _FOLLOWS.items():
        if any(known.get(name, 0.0) <= 0.0 or found.get(name, 0.0) <= 0.0 for name in powers):
            return None
        moved = {name: math.log(found[name] / known[name]) for name in powers}
        size = sum(powers[name] * moved[name] for name in powers) / sum(power**2 for power in powers.values())
        if abs(size) > _LEAST and all(abs(moved[name] - powers[name] * size) < _ALIKE * abs(size) for name in powers):
            return quantity, math.exp(size)
    return None


def told_by_rows(plant: Plant, recordings: Sequence[Recording]) -> dict[str, float]:
    """Return the parameters of a pmsm that the rows of the recordings tell, by least squares; none that they do not."""
    pairs = next(p.value for p in plant.parameters if p.name == "pole_pairs")
    frames = [(one.time, rotor_frame(one.columns, pairs)) for one in recordings]
    rows = [_rows(time, frame) for time, frame in frames if frame is not None]
    if not rows:
        return {}
    h, v_d, v_q, d, q, w, risen_d, risen_q, gained = np.concatenate(rows, axis=1)
    electric = pairs * w
    by_v_d, by_d, _ = _told([v_d, -d, electric * q], risen_d, h)
    by_v_q, by_q, _, by_flux = _told([v_q, -q, -electric * d, -electric], risen_q, h)
    along, across, flux = 1.0 / by_v_d, 1.0 / by_v_q, by_flux / by_v_q
    torque = 1.5 * pairs * (flux * q + (along - across) * d * q)
    by_torque, *_ = _told([torque, -w, np.ones_like(w)], gained, h)
    found = {
        "R_ohm": 0.5 * (by_d * along + by_q * across),
        "Ld_H": along,
        "Lq_H": across,
        "flux_Wb": flux,
        "J_kg_m2": 1.0 / by_torque,
    }
    return {name: value for name, value in found.items() if math.isfinite(value)}


def _rows(time: Array, frame: RotorFrame) -> Array:
    """Return from row to row (9, n - 1): how long, voltages, mean currents and speed, and by how much those rise."""
    i, w = frame.current, frame.speed
    mean, risen = 0.5 * (i[1:] + i[:-1]), np.diff(i)
    held = frame.voltage[:-1]
    read = (held.real, held.imag, mean.real, mean.imag, 0.5 * (w[1:] + w[:-1]), risen.real, risen.imag, np.diff(w))
    return np.array([np.diff(time), *read])


def _told(regressors: Sequence[Array], change: Array, h: Array) -> list[float]:
    """Return the coefficients of rates that changes (n,) over rows of `h` (n,) tell; NaN for what they do not."""
    told = regressed(np.column_stack(regressors) * h[:, None], change)
    if told is None:
        return [math.nan] * len(regressors)
    found, deviations, _ = told
    return [float(one) for one in np.where(deviations < _TOLD * np.abs(found), found, np.nan)]


def says(plant: Plant, quantity: str, factor: float) -> str:
    """Say which columns look off, and the line that mends them."""
    wires = [signal.name for signal in (*plant.inputs, *plant.outputs)]
    names = ["supply_V"] if quantity == "voltage" and "supply_V" in wires else []
    names = names or [name for name in wires if name.startswith(f"{quantity}_")]
    unit = unit_of_factor(factor, _UNIT, names[0] if names else "")
    named = f" ({unit})" if unit in ELECTRIC else ""
    factor = FACTORS[str(unit)] if named else float(f"{factor:.2g}")  # a data sheet knows no more
    lines = " and ".join(scale_line(name, 1.0 / factor) for name in names)
    write = f"write in [recordings.rename], with the names in the file on the left, {lines}"
    cure = write if named else "give them in [recordings.rename] the exact scale of their divider, shunt or unit"
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
        f"are met with {follow} what [plant.parameters] gives, all by one factor; {cure}, "
        "or correct all these parameters"
    )


CHECK = Check(
    "electrical_scale", look, ("scale", "rest", "drift", "structure", "excitation"), False, ("identify", "diagnose")
)

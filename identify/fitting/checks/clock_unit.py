"""Time stamps in another unit than seconds: the plant as given fits them only when they are converted."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import numpy as np

from firmloop.identify.fitting.check import Check
from firmloop.identify.fitting.evidence import Evidence, unexplained
from firmloop.identify.plants.plant import Parameter, Plant
from firmloop.identify.recordings.recording import Recording
from firmloop.identify.simulation.linearize import linearize

_UNITS = {"milliseconds": 1e-3, "microseconds": 1e-6, "minutes": 60.0, "thousands of seconds": 1e3, "hours": 3600.0}
_ALIKE = 0.9  # correlation of every output with the plant as given, on the right clock
_OVER = 3.0  # time constants, after which 5 % of a decay is left
_STILL = 1e-9  # of the quickest mode: what only sums up
_SHARE = 0.4  # of the clock's factor, in logarithms, that a value has to have moved to make up for it
_WINDING, _ROTOR = 0.2, 1e-4  # s; time constants beyond those of any motor that is sold
_TOLD = 0.1  # relative deviation of a parameter that the recordings tell
_BETTER = 0.4  # of what is not explained on the clock as it is


def look(evidence: Evidence) -> tuple[str, ...]:
    """Try every unit on the first recording, and ask whether a motor has the time constants that are found."""
    return _other_unit(evidence) or _no_motor(evidence)


def _no_motor(evidence: Evidence) -> tuple[str, ...]:
    """Tell time constants that no motor has: as given they may fit the clock as it is, and be as wrong.

    A voltage or a current in another unit leaves both as they are.
    """
    if evidence.fit is None or evidence.fit.plant.kind != "dc_motor":
        return ()
    held = {p.name: p for p in evidence.fit.plant.parameters}
    known = {name: p.value for name, p in held.items() if p.value > 0.0 and _is_told(p)}
    source, cure = evidence.recordings[0].source, "give the column its unit in [recordings.rename], or convert it"
    if {"L_H", "R_ohm"} <= known.keys() and (slow := known["L_H"] / known["R_ohm"]) > _WINDING:
        says = f"time_s of {source} looks like milliseconds: L_H / R_ohm comes out as {slow:.3g} s"
        return (f"{says}, and no winding of a motor takes more than {_WINDING:g} s to fill; {cure}",)
    if {"J_kg_m2", "R_ohm", "kt_N_m_A", "ke_V_s_rad"} <= known.keys():
        quick = known["J_kg_m2"] * known["R_ohm"] / (known["kt_N_m_A"] * known["ke_V_s_rad"])
        if quick < _ROTOR:
            says = f"time_s of {source} looks like thousands of seconds: J R / (kt ke) comes out as {quick:.3g} s"
            return (f"{says}, and no rotor comes up to speed in less than {_ROTOR:g} s; {cure}",)
    return ()


def _is_told(parameter: Parameter) -> bool:
    return not parameter.free or (parameter.deviation is not None and parameter.deviation < _TOLD * parameter.value)


def _other_unit(evidence: Evidence) -> tuple[str, ...]:
    recording = evidence.recordings[0]
    plain = unexplained(evidence, recording)
    if plain is None or max(plain) < 1.0 - _ALIKE**2:
        return ()  # it follows the clock as it is
    swings, settles = _rates(evidence.given)
    step = float(np.median(np.diff(recording.time)))
    # What swings more than once between two rows, or is over before the next, nobody has recorded; it takes hours too.
    shortest = min(np.pi / swings if swings else np.inf, _OVER / settles if settles else np.inf)
    units = {unit: factor for unit, factor in _UNITS.items() if step * factor < shortest}
    tried = {unit: unexplained(evidence, _converted(recording, factor)) for unit, factor in units.items()}
    known = {unit: shares for unit, shares in tried.items() if shares is not None}
    if not known:
        return ()
    unit = min(known, key=lambda each: float(np.sum(known[each])))
    shares = known[unit]
    if max(shares) > 1.0 - _ALIKE**2 or float(np.sum(shares)) > _BETTER * float(np.sum(plain)):
        return ()
    if any(winding > _WINDING for winding in _windings(evidence, _UNITS[unit])):
        return ()  # what was given is off, and not the clock
    guess = _guess(evidence, recording, _UNITS[unit], shares)
    explains = (
        f"the plant as given then explains {100.0 * (1.0 - max(shares)):.0f} % of every output, and "
        f"{100.0 * (1.0 - max(plain)):.0f} % on the clock as it is"
    )
    cure = "give the column its unit in [recordings.rename], or convert it"
    if guess is None:
        return (f"time_s of {recording.source} looks like {unit}: {explains}; {cure}",)
    given, found = guess
    return (
        f"time_s of {recording.source} looks like {unit}, or {given.name} = {given.value:.4g} {given.unit} was a guess "
        f"far off: {explains}, on which the fit finds {found.value:.4g} {given.unit}; if that may be, leave the clock "
        f"as it is; if not, {cure}",
    )


def _windings(evidence: Evidence, factor: float) -> list[float]:
    """Return L/R of a motor (s) as given, and as found on a clock `factor` times as slow."""
    fitted = [] if evidence.fit is None else [(evidence.fit.plant, factor)]
    found = []
    for plant, times in ((evidence.given, 1.0), *fitted):
        held = {p.name: p for p in plant.parameters if plant is evidence.given or _is_told(p)}
        if plant.kind == "dc_motor" and {"L_H", "R_ohm"} <= held.keys() and held["R_ohm"].value > 0.0:
            found.append(times * held["L_H"].value / held["R_ohm"].value)
    return found


def _guess(
    evidence: Evidence, recording: Recording, factor: float, shares: list[float]
) -> tuple[Parameter, Parameter] | None:
    """Return the one parameter of time, as given and as found, that makes up for the clock: a guess is as likely then.

    Several that all go the same way speak for the clock.
    """
    if evidence.fit is None:
        return None
    found = {each.name: each for each in evidence.fit.plant.parameters}
    moved = [
        (each, found[each.name])
        for each in evidence.given.parameters
        if each.free and each.name in found and each.value * found[each.name].value > 0.0
        if re.search(r"(?<![A-Za-z])s(?![A-Za-z])", each.unit)
        if abs(math.log(found[each.name].value / each.value)) > _SHARE * abs(math.log(factor))
    ]
    left = unexplained(replace(evidence, given=evidence.fit.plant), recording)
    return moved[0] if len(moved) == 1 and left is not None and sum(left) < sum(shares) else None


def _rates(plant: Plant) -> tuple[float, float]:
    """Return the quickest swing and the slowest decay (rad/s) of the plant about rest; 0 where it has none."""
    modes = np.linalg.eigvals(linearize(plant).a)
    decays = np.abs(modes[np.abs(modes) > _STILL * np.max(np.abs(modes), initial=0.0)])
    return float(np.max(np.abs(modes.imag), initial=0.0)), float(np.min(decays)) if len(decays) else 0.0


def _converted(recording: Recording, factor: float) -> Recording:
    return replace(recording, time=recording.time * factor)


CHECK = Check(
    "clock_unit", look, ("sign", "scale", "motor_constants", "early", "rest", "drift", "structure", "excitation"), False
)

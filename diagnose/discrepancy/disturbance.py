"""Size what is still missing: the disturbance in each balance that makes outputs differ as they do."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from firmloop.diagnose.discrepancy.locate import nominal_plant
from firmloop.diagnose.finding import Disturbance
from firmloop.diagnose.model.disturbed_plant import followed, groups
from firmloop.diagnose.model.fit import fit_starts
from firmloop.diagnose.model.sensor_noise import sensor_noises
from firmloop.diagnose.model.slopes import residual_of
from firmloop.diagnose.policy import (
    CONTROLLER_BY_CHANCE,
    CONTROLLER_ROWS,
    HELD_INPUT,
    MOST_SMOOTHED_ROWS,
    RIVALS_DRIVE,
)
from firmloop.diagnose.search.found import Search
from firmloop.diagnose.search.simulation_error import answered, mostly, unlike_noise
from firmloop.identify.fitting.noise import fit_noise, flat
from firmloop.identify.plants.attach import with_effects
from firmloop.identify.plants.plant import Balance, Plant
from firmloop.identify.recordings.recording import Recording
from firmloop.identify.simulation.engine import effect_simulator
from firmloop.identify.simulation.linearize import linearize
from firmloop.identify.simulation.simulate import constants_of, course_of, rest_start
from firmloop.identify.simulation.superset import along

Array = NDArray[np.float64]


def rivals_noise(search: Search) -> bool:
    """Tell whether what the plant alone leaves is more than noise may be, and than a disturbance below half the drive.

    What answers the input in most recordings is no disturbance, however little; of what is more than noise may be in
    its slow part, or far more than a sensor's own, one recording tells as much. Where a balance is known: a push that
    is little beside the drive may lead a position far away.
    """
    problem, alone = search.problem, search.nominal
    plant, lefts = _refitted(search)
    answers = _answers(search, lefts)
    if mostly(answers):
        return True
    if not unlike_noise(problem, alone):
        return False
    if any(answers):
        return True
    found = disturbances(plant, problem.train, lefts, sensor_noises(lefts, problem.floors))
    shares = [each.share for each in found.values() if each.share is not None]
    return not shares or max(shares) > RIVALS_DRIVE


def _refitted(search: Search) -> tuple[Plant, Sequence[Array]]:
    """Return the plant that stands where nothing is explained, and what its simulations leave (n, r), as is printed."""
    problem, alone = search.problem, search.nominal
    if search.refit is None:
        return nominal_plant(search, alone), alone.fitted.residuals
    values = {**alone.fitted.point.values, **{p.name: p.value for p in search.refit.parameters}}
    point = fit_starts(problem, problem.train, values, flat(alone.noises))
    lefts = [residual_of(problem, recording, point, k) for k, recording in enumerate(problem.train)]
    return problem.plant.valued(values), lefts


def _answers(search: Search, lefts: Sequence[Array]) -> list[bool]:
    """Tell of each recording whose input no controller made whether that explains some of what is left (n, r).

    A controller answers a disturbance; an input that stands still in most rows was not made by one.
    """
    problem, refit = search.problem, search.refit
    if refit is None or len(refit.inputs) != 1:
        return []
    drives = [each.columns[refit.inputs[0].name] for each in problem.train]
    still = [float(np.mean(np.diff(drive) == 0.0)) > HELD_INPUT for drive in drives]
    given = {k: left for k, left in enumerate(lefts) if still[k] or not made_from(drives[k], left)}
    return answered(problem, refit, given, not unlike_noise(problem, search.nominal)) if given else []


def made_from(drive: Array, left: Array) -> bool:
    """Tell whether an input (n,) follows what its own past cannot tell of a residual (n, r), as a controller's does.

    By the correlation of the innovations of both (L. D. Haugh, Journal of the American Statistical Association 71
    (1976) 378-385): what a plant makes of its input comes later than that, what a controller makes of noise does not.
    """
    if not np.all(np.isfinite(left)):
        return True
    both = [_innovations(values) for values in (drive, *left.T)]
    rows = min(map(len, both))
    own, *others = (each[len(each) - rows :] for each in both)
    follows = [abs(float(own[k:] @ each[: rows - k])) for each in others for k in range(CONTROLLER_ROWS)]
    return max(follows) > CONTROLLER_BY_CHANCE * math.sqrt(rows)


def _innovations(values: Array) -> Array:
    """Return whether each row of a signal is above or below what its past tells; the first rows have no past."""
    away = values - np.mean(values)
    noise = fit_noise([away], 0.0)
    return np.sign(noise.whiten(away)[len(noise.coefficients) :])


def disturbances(
    plant: Plant, recordings: Sequence[Recording], residuals: Sequence[Array], noise: Sequence[float]
) -> dict[str, Disturbance]:
    """Return the disturbance that leaves the residuals (n, r) of each recording, by balance.

    The smoothed disturbances of measured outputs minus those of simulated ones: the smoother is linear. `noise` (r,) is
    the rms of each sensor's own. Where there are more balances than outputs each is taken to be the only one disturbed.
    """
    plant = with_effects(plant, ())
    if not all(np.all(np.isfinite(part)) for part in residuals):
        return {}
    found = {}
    for group in groups(plant):
        sizes = _sizes(plant, group, recordings, residuals, noise)
        for balance, rms in zip(group if sizes else (), sizes, strict=True):
            drive = _drive(plant, balance, recordings)
            share = rms / drive if drive > 0.0 else None
            found[_name(plant, balance)] = Disturbance(rms, balance_unit(plant, balance), share)
    return found


def _sizes(
    plant: Plant,
    balances: Sequence[Balance],
    recordings: Sequence[Recording],
    residuals: Sequence[Array],
    noise: Sequence[float],
) -> list[float]:
    """Return the rms of the disturbances of these balances that make the residuals likeliest; none where none do."""
    best, unlikely = followed(plant, balances, recordings, residuals, noise)
    if not np.isfinite(unlikely):
        return []
    states = len(plant.states)
    power, rows = np.zeros(len(balances)), 0
    for each, left in zip(best, residuals, strict=True):
        some = left[:MOST_SMOOTHED_ROWS]
        unforced = np.zeros((len(some), states + len(balances)))
        power += np.sum(each.smoothed(some, unforced, each.begin(some)[0])[:, states:] ** 2, axis=0)
        rows += len(some)
    return [float(size) for size in np.sqrt(power / rows)]


def _drive(plant: Plant, balance: Balance, recordings: Sequence[Recording]) -> float:
    """Return the rms of what the input gives a balance; 0 where it gives none, or where that cannot be told."""
    constants = np.array([each.value for each in plant.parameters])
    power, rows = 0.0, 0
    for recording in recordings:
        course = course_of(plant, recording)
        if balance.effort is None:
            each = course.drive @ linearize(plant).b[balance.state] / float(balance.per(constants))
        else:
            engine = effect_simulator(plant)
            states = engine.run_states(course, constants, rest_start(plant, recording))
            for index, signal in enumerate(plant.states):
                if signal.name in recording.columns:
                    states[:, index] = recording.columns[signal.name]
            each = along(balance.effort, states, course.drive, constants)
        power += float(each @ each)
        rows += len(each)
    return float(np.sqrt(power / rows)) if np.isfinite(power) else 0.0


def _name(plant: Plant, balance: Balance) -> str:
    """Return the kind of a balance, with its state where there are several of that kind."""
    several = sum(each.kind == balance.kind for each in plant.balances) > 1
    return f"{balance.kind} of {plant.states[balance.state].name}" if several else balance.kind


_UNITS: Mapping[str, str] = {"torque": "N*m", "force": "N", "voltage": "V", "winding": "V", "axes": "V"}
# The unit of a state, and of what stores it: a flow into a vessel, a heat, a current.
_FLOWS = {("m", "m^2"): "m^3/s", ("degC", "J/K"): "W", ("K", "J/K"): "W", ("V", "F"): "A"}


def balance_unit(plant: Plant, balance: Balance) -> str:
    """Return the unit of what acts in a balance; blank where only the project could know it."""
    if plant.delay is not None:  # a lag, in which all is in the output's unit
        return plant.outputs[0].unit
    if balance.kind in _UNITS:
        return _UNITS[balance.kind]
    bare = with_effects(plant, ())
    per = float(balance.per(constants_of(bare)))
    shares = linearize(bare).b[balance.state] / per
    same = [signal.unit for signal, share in zip(plant.inputs, shares, strict=True) if abs(share - 1.0) < 1e-9]
    stored = plant.states[balance.state].unit
    stores = [parameter.unit for parameter in plant.parameters if abs(per * parameter.value - 1.0) < 1e-9]
    flows = [_FLOWS[stored, unit] for unit in stores if (stored, unit) in _FLOWS]
    return next(iter((*same, *flows)), "")

"""Tell from the truth alone what a hidden effect shows: the best refit of the truth without it, over the noise."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bench.diagnose.blind_cases import COLUMN, ROWS, STEP, TAIL, Case, held_still, true_values
from bench.diagnose.concealed import Concealed
from bench.diagnose.truth import Sensor, folded, read, run

Array = NDArray[np.float64]
Simulation = Callable[[Array], Array]  # parameters (k,) -> outputs over their noise (n, r)

SUBSTEPS = 10  # a row; both sides of a comparison take the same
TURNS = 12  # of Gauss-Newton
_SECANT = 1e-4
_UNSEEN = 0.3  # of the noise: what leaves less is not looked at closer
_MOTOR = ("R", "L", "ke", "kt", "J", "b")
_NAMES = {"R_ohm": "R", "L_H": "L", "kt_N_m_A": "kt"}


def least_left(simulation: Simulation, seen: Array, begin: Array) -> float:
    """Return the rms over noise, of the output where that is largest, of the best fit to `seen` (n, r) from `begin`.

    Gauss-Newton on secants; what the data cannot tell stays where it is, and a step that leads uphill is halved.
    """
    at = begin
    left = seen - simulation(at)
    for _ in range(TURNS):
        if _largest(left) < _UNSEEN:
            break
        try:
            slopes = np.stack([(simulation(at + _SECANT * unit) - seen + left) / _SECANT for unit in np.eye(len(at))])
        except ArithmeticError:
            break  # one step further the truth diverges
        away = np.linalg.lstsq(slopes.reshape(len(at), -1).T, left.ravel(), rcond=1e-8)[0]
        away *= min(1.0, 1.0 / max(float(np.max(np.abs(away))), 1e-12))  # logarithms: at most e times in one step
        for _ in range(6):
            try:
                tried = seen - simulation(at + away)
                if np.sum(tried**2) < np.sum(left**2):
                    break
            except ArithmeticError:
                pass  # where the truth diverges nothing is met
            away = 0.5 * away
        else:
            break
        gained = 1.0 - float(np.sum(tried**2) / np.sum(left**2))
        at, left = at + away, tried
        if gained < 1e-3:
            break
    return _largest(left)


def _largest(left: Array) -> float:
    return float(np.max(np.sqrt(np.mean(left**2, axis=0))))


@dataclass(frozen=True, slots=True)
class _Shown:
    """The truth of some of what a case hides, driven by the inputs that its recordings hold."""

    case: Case
    drives: Sequence[Array]
    noise: Sequence[float]
    values: Mapping[str, float]
    hidden: tuple[Concealed, ...]

    def outputs(self, values: Mapping[str, float], hidden: Sequence[Concealed], zero: float) -> Array:
        """Return all recordings' outputs over their noise (n, r); `zero` moves a position as its start would."""
        found = []
        still = np.zeros(ROWS + TAIL)
        for drive in self.drives:
            _, fine = run(values, drive, STEP, None, still, SUBSTEPS)
            columns = []
            for quantity, noise in zip(self.case.sensors, self.noise, strict=True):
                faults = [each.sensor[1] for each in hidden if each.sensor and each.sensor[0] == quantity]
                fault = faults[0] if faults and faults[0].fault != "sensor_wrap" else None
                skew = sum(each.skew for each in hidden)
                column = read(quantity, fine, STEP, ROWS, fault, skew, SUBSTEPS)
                columns.append((column + (zero if quantity == "position" else 0.0)) / noise)
            found.append(np.stack(columns, axis=1))
        return np.concatenate(found)

    def fitted(self) -> tuple[Simulation, Array]:
        """Return the simulation of plant and hidden effects by the logarithms of their figures, and where it begins.

        Phases and a count of periods stay; a position may begin anywhere.
        """
        plant = [key for key in (_MOTOR if self.case.machine.motor else ("J", "b")) if self.values.get(key, 0.0) > 0.0]
        held = {_NAMES[name] for name in held_still(self.case.sensors, self.case.machine) if name in _NAMES}
        mine = [key for each in self.hidden for key in each.truth if not key.endswith(("_phase", "_n"))]
        free = [key for key in (*plant, *mine) if key not in held and self.values.get(key, 0.0) > 0.0]
        sensors = [(k, key) for k, each in enumerate(self.hidden) if each.sensor for key in each.sensor[1].size]
        sensors = [(k, key) for k, key in sensors if key != "phase"]

        def simulation(at: Array) -> Array:
            factors = np.exp(at[:-1])
            values = {**self.values, **{key: self.values[key] * f for key, f in zip(free, factors, strict=False)}}
            hidden = list(self.hidden)
            for (k, key), factor in zip(sensors, factors[len(free) :], strict=True):
                name, fault = hidden[k].sensor or ("", Sensor("", {}))
                size = {**fault.size, key: fault.size[key] * float(factor)}
                hidden[k] = replace(hidden[k], sensor=(name, Sensor(fault.fault, size)))
            return self.outputs(values, hidden, float(at[-1]))

        return simulation, np.zeros(len(free) + len(sensors) + 1)


def shows(case: Case, drives: Sequence[Array], noises: Mapping[str, float]) -> tuple[dict[str, float], float]:
    """Return what each hidden effect leaves over the noise, by its name, and what physics outside the library leaves.

    Plant, sizes of all else that is hidden and the start are fitted to the noise-free outputs. Steps and jumps of a
    reading, which no fit can follow, show by what they do to that reading.
    """
    columns = [COLUMN[case.machine.motor][quantity] for quantity in case.sensors]
    noise = [max(noises[name], 1e-12) for name in columns]
    longer = [np.concatenate([drive, np.full(TAIL, drive[-1])]) for drive in drives]
    whole = _Shown(case, longer, noise, true_values(case), case.hidden)
    seen = whole.outputs(whole.values, whole.hidden, 0.0)
    found = {}
    for each in case.hidden:
        if each.resolution or each.name == "sensor_wrap":
            found[each.name] = _jumps(case, each, noise, seen)
            continue
        rest = tuple(other for other in case.hidden if other is not each)
        values = {key: value for key, value in whole.values.items() if key not in each.truth}
        values["J"] += each.truth.get("coupled_inertia", 0.0)
        found[each.name] = least_left(*_turned(replace(whole, values=values, hidden=rest), seen))
    outside = 0.0
    if case.outside:
        known = {*case.machine.values, "is_motor", "kt", "ke", "R", "L"} | {k for e in case.hidden for k in e.truth}
        values = {key: value for key, value in whole.values.items() if key in known}
        outside = least_left(*_turned(replace(whole, values=values), seen))
    return found, outside


def _turned(shown: _Shown, seen: Array) -> tuple[Simulation, Array, Array]:
    simulation, begin = shown.fitted()
    return simulation, seen, begin


def _jumps(case: Case, each: Concealed, noise: Sequence[float], seen: Array) -> float:
    """Return what rounding or wrapping changes of a reading, over its noise without that."""
    if each.resolution:
        (quantity, step), *_ = each.resolution.items()
        size, rounding = noise[case.sensors.index(quantity)], step / np.sqrt(12.0)
        return float(rounding / np.sqrt(max(size**2 - rounding**2, 1e-6 * size**2)))
    assert each.sensor is not None
    k = case.sensors.index(each.sensor[0])
    values = seen[:, k] * noise[k]
    return float(np.sqrt(np.mean((folded(values, each.sensor[1].size["range"]) - values) ** 2)) / noise[k])

"""Make recordings ready to be searched: refuse what cannot be, and keep what a search can afford."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from firmloop.diagnose.data.intersample import believed_hold, fitted_nominal
from firmloop.diagnose.policy import (
    APART_POWER,
    CLOCK_GAP_STEPS,
    CLOSE_POWER,
    CLOSED_GAP_POWER,
    CONSTANT_WEIGHT,
    COPIED_ROWS,
    COPIED_VALUES,
    FAR_START,
    MET_POWER,
    MOST_ROWS,
    NONLINEAR_ROW_COST,
    OTHER_MACHINE,
    SAME_CONSTANT,
    STEPS_OF_A_READ_FIT,
    STRETCH_PLACES,
    TRIAL_ROWS,
    UNSEEN_COMBINATION,
    USUAL_GAPS,
)
from firmloop.identify.error import IdentifyError
from firmloop.identify.plants.linear_forms import form_writer
from firmloop.identify.plants.per_recording import ways_to_differ, with_varying, without_varying
from firmloop.identify.plants.plant import Plant
from firmloop.identify.recordings.hold import FINER, HOLDS
from firmloop.identify.recordings.recording import Recording, make_recording

Array = NDArray[np.float64]

_SOAK = ("b_", "L_", "delay_")  # parameters that move far to imitate an effect
_TORQUE, _VOLTAGE = "kt_N_m_A", "ke_V_s_rad"


def prepared(
    plant: Plant, train: Sequence[Recording], test: Sequence[Recording]
) -> tuple[tuple[Recording, ...], tuple[Recording, ...]]:
    """Return the recordings to search, those that are too long cut to their liveliest stretch."""
    check_apart(plant, train, test)
    check_clock(plant, (*train, *test))
    hold = believed_hold(plant, shortened(plant, train, MOST_ROWS // (2 * FINER))) if train else HOLDS[0]
    rows = MOST_ROWS // (2 * FINER if hold == "band_limited" else 1)
    if not form_writer(plant).linear_rate:
        rows = rows // NONLINEAR_ROW_COST
    seen, unseen = (shortened(plant, part, rows) for part in (train, test))
    return tuple(replace(each, hold=hold) for each in seen), tuple(replace(each, hold=hold) for each in unseen)


def check_apart(plant: Plant, train: Sequence[Recording], test: Sequence[Recording]) -> None:
    """Refuse a test recording that is a train recording, or a part of one, under another name or with another clock."""
    names = [signal.name for signal in (*plant.inputs, *plant.outputs)]
    for one in test:
        rows = np.column_stack([one.columns[name] for name in names if name in one.columns])
        for other in train:
            held = np.column_stack([other.columns[name] for name in names if name in other.columns])
            if held.shape[1] != rows.shape[1]:
                continue
            for begin in np.linspace(0, max(len(rows) - COPIED_ROWS, 0), STRETCH_PLACES).astype(int):
                part = rows[begin : begin + COPIED_ROWS]
                if len(part) < COPIED_ROWS or len(np.unique(part[:, -1])) < COPIED_VALUES:
                    continue
                for at in np.flatnonzero(np.all(held == part[0], axis=1)):
                    if np.array_equal(held[at : at + COPIED_ROWS], part):
                        raise IdentifyError(
                            f"recordings.test: {one.source} repeats {other.source} from {other.time[at]:.6g} s on, "
                            "value for value; what was fitted cannot judge the fit, so record another one"
                        )


def check_clock(plant: Plant, recordings: Sequence[Recording]) -> None:
    """Refuse a clock that jumps where the motion goes on: rows that are missing leave a gap in both."""
    for recording in recordings:
        gaps = np.diff(recording.time)
        step, worst = float(np.median(gaps)), int(np.argmax(gaps))
        # As long as many others, it is how the rows were taken: a controller that waits now and then logs so.
        if gaps[worst] < CLOCK_GAP_STEPS * float(np.quantile(gaps, USUAL_GAPS)):
            continue
        near = slice(max(worst - TRIAL_ROWS // 2, 0), worst + TRIAL_ROWS // 2)
        part = replace(recording, time=recording.time[near], columns={k: v[near] for k, v in recording.columns.items()})
        stamps = part.time.copy()
        stamps[worst + 1 - near.start :] -= gaps[worst] - step
        try:
            open_, closed = (_trial(plant, [each]).power for each in (part, replace(part, time=stamps)))
        except IdentifyError:
            continue
        if closed < CLOSED_GAP_POWER * open_:
            raise IdentifyError(
                f"{recording.source}: time_s jumps by {gaps[worst]:.4g} s after {recording.time[worst]:.6g} s, but the "
                "motion goes on as if it had not; correct the time stamps, or cut the recording there"
            )


class Apart(NamedTuple):
    """Why recordings seem to be of two machines, and what a fit to each alone leaves a row, in squares of the spread.

    A finding that leaves little more of all together takes it back: what is missing looks so, too.
    """

    says: str
    left: float

    def made_one(self, outputs: Sequence[Array], residuals: Sequence[Array]) -> bool:
        """Tell whether residuals (n, r) of all outputs (n, r) are about as small as those of a fit to each alone."""
        left = np.sum((np.concatenate(residuals) / _spread(outputs)) ** 2, axis=1)
        return float(np.mean(left)) < APART_POWER * self.left


def two_machines(plant: Plant, train: Sequence[Recording]) -> Apart | None:
    """Say why train recordings are of two machines: each alone is met well, by other parameters than the next.

    None where they may be of one. Where there are more than two, all of either machine must be met together: what a
    missing effect makes of one machine's parameters differs from recording to recording.
    """
    short = shortened(plant, train, TRIAL_ROWS)
    if len(short) < 2:
        return None
    columns = [np.column_stack([each.columns[signal.name] for signal in plant.outputs]) for each in short]
    whole = _spread(columns)
    if any(np.any(np.std(each, axis=0) == 0.0) for each in columns):
        return None
    try:
        alone = [_best_trial(plant, [each], _trial(plant, [each])) for each in short]
        together = _trial(plant, short)
    except IdentifyError:
        return None
    powers = [_scaled(each, [column], whole) for each, column in zip(alone, columns, strict=True)]
    met = all(each.power < MET_POWER * len(each.slopes) for each in alone)
    if not met or together.power < APART_POWER * sum(powers):
        return None
    free = {p.name for p in plant.parameters if p.free}
    first = {name: value for name, value in alone[0].values.items() if name in free}
    shifts = [_seen_shifts(other, first) for other in alone]
    for index, moved in enumerate(shifts):
        far = max(moved, key=lambda each: abs(moved[each]), default="")
        if far and abs(moved[far]) > np.log(OTHER_MACHINE):
            first_one = [abs(each.get(far, 0.0)) < abs(each.get(far, 0.0) - moved[far]) for each in shifts]
            groups = [[k for k, mine in enumerate(first_one) if mine == which] for which in (True, False)]
            if not all(groups):
                continue  # no recording is like the other
            both = 0.0
            for group in groups:
                parts = [columns[k] for k in group]
                found = alone[group[0]] if len(group) == 1 else _trial(plant, [short[k] for k in group])
                both += _scaled(found, parts, whole)
            if together.power < APART_POWER * both:
                continue
            says = (
                f"{short[0].source} and {short[index].source} are not of one plant: alone they are met best with "
                f"{far} = {first[far]:.3g} and {first[far] * np.exp(moved[far]):.3g}, together "
                f"{together.power / sum(powers):.2g} times as much is left. {_question(plant, short, both, far)}; else "
                "diagnose one machine at a time, or, if each stands at another level and a loss bends with it "
                '(radiation, convection, drag), write that loss with plant.kind = "ode"'
            )
            return Apart(says, sum(powers) / sum(map(len, columns)))
    return None


def _spread(columns: Sequence[Array]) -> Array:
    """Return the spread (r,) of outputs (n, r) over several recordings."""
    return np.asarray(np.std(np.concatenate(columns), axis=0))


def _question(plant: Plant, train: Sequence[Recording], power: float, far: str) -> str:
    """Ask whether it is one machine of which something differs from file to file: what makes them one if it does."""
    bare, listed = without_varying(plant), [one.name for one in plant.varying]
    ways = [each for each in ways_to_differ(bare) if not set(each) & set(listed)]
    names: tuple[str, ...] = (far,)
    for tried in ([(far,), *(each for each in ways if len(each) == 1)], [each for each in ways if len(each) > 1]):
        left = {each: _as_one(bare, train, (*listed, *each)) for each in tried}
        best = min(left, key=lambda each: left[each], default=(far,))
        if left.get(best, np.inf) < APART_POWER * power:
            names = best
            break
    told = ", ".join(f'"{name}"' for name in dict.fromkeys((*listed, *names)))
    return (
        f"Is it one machine, of which {' and '.join(names)} may differ from file to file? Then write [recordings] "
        f"per_recording = [{told}]"
    )


def _as_one(plant: Plant, train: Sequence[Recording], names: Sequence[str]) -> float:
    """Return what is left of all recordings where these values differ between them."""
    try:
        return _trial(with_varying(plant, list(dict.fromkeys(names))), train).power
    except IdentifyError:
        return np.inf


def _scaled(trial: _Trial, columns: Sequence[Array], whole: Array) -> float:
    """Return what is left in units of the spread (r,) of all recordings; a fit weighs by that of its own."""
    return trial.power * float(np.max((_spread(columns) / whole) ** 2))


@dataclass(frozen=True, slots=True)
class _Trial:
    """Where a fit of the nominal plant ended: what is left, the values, and the slopes (q, k) for their logarithms."""

    power: float
    values: Mapping[str, float]
    slopes: Array
    names: tuple[str, ...]


def _best_trial(plant: Plant, train: Sequence[Recording], begun: _Trial) -> _Trial:
    """Return the best of the fit from where the plant is given and those from a tenth and ten times each parameter."""
    best, off = begun, begun.power >= CLOSE_POWER * len(begun.slopes)  # else there is next to nothing to gain
    for index, parameter in enumerate(plant.parameters):
        for factor in (0.1, 10.0) if off and parameter.free and parameter.value > 0.0 else ():
            value = parameter.value * factor
            if parameter.low <= value <= parameter.high:
                moved = list(plant.parameters)
                for place in _together(plant, index):
                    moved[place] = replace(moved[place], value=moved[place].value * factor)
                best = min(best, _trial(replace(plant, parameters=tuple(moved)), train), key=lambda each: each.power)
    return best


def _together(plant: Plant, index: int) -> tuple[int, ...]:
    """Return the places of what a parameter is wrong together with: a motor's two constants, given as the same."""
    names = [parameter.name for parameter in plant.parameters]
    if names[index] not in (_TORQUE, _VOLTAGE) or not {_TORQUE, _VOLTAGE} <= set(names):
        return (index,)
    both = tuple(names.index(name) for name in (_TORQUE, _VOLTAGE))
    one, other = (plant.parameters[place].value for place in both)
    return both if one > 0.0 and other > 0.0 and abs(np.log(one / other)) < SAME_CONSTANT else (index,)


def _trial(plant: Plant, train: Sequence[Recording]) -> _Trial:
    problem, point, pairs = fitted_nominal(plant, train, STEPS_OF_A_READ_FIT)
    power = sum(float(np.sum(residual**2)) for residual, _ in pairs)
    every = [parameter.name for parameter in plant.parameters]
    values = dict(zip(every, map(float, point.constants), strict=True))
    names = tuple(every[index] for index in problem.free)
    scale = np.where(problem.logarithmic, 1.0, [values[name] for name in names])
    slopes = np.concatenate([part[..., : len(names)].reshape(-1, len(names)) * scale for _, part in pairs])
    return _Trial(power if np.isfinite(power) else np.inf, values, slopes, names)


def _seen_shifts(found: _Trial, given: Mapping[str, float]) -> dict[str, float]:
    """Return the logarithms by which the judged parameters moved, the least ones that do the same to the outputs.

    In SI units a motor's torque constant is its voltage constant: where they were given so, they move together, and
    where they were given far apart, one of them is wrong.
    """
    names = [name for name in found.names if given.get(name, 0.0) > 0.0 and found.values[name] > 0.0]
    shift = np.array([np.log(found.values[name] / given[name]) for name in names])
    slopes = found.slopes[:, [found.names.index(name) for name in names]]
    sizes = np.linalg.norm(slopes, axis=0)
    if not names or not np.all(np.isfinite(sizes)) or np.any(sizes == 0.0):
        return {}
    _, size, basis = np.linalg.svd(slopes, full_matrices=False)
    unseen = basis[size < UNSEEN_COMBINATION * size[0]].T
    judged = np.array([not name.startswith(_SOAK) for name in names])
    if unseen.size:
        weight, aim = np.diag(np.where(judged, 1.0, 1e-3)), np.zeros(len(names))
        if {_TORQUE, _VOLTAGE} <= set(names):
            apart = float(np.log(given[_TORQUE] / given[_VOLTAGE]))
            if abs(apart) < SAME_CONSTANT or abs(apart) > np.log(FAR_START):
                ratio = np.zeros((1, len(names)))
                ratio[0, [names.index(_TORQUE), names.index(_VOLTAGE)]] = CONSTANT_WEIGHT, -CONSTANT_WEIGHT
                weight = np.concatenate([weight, ratio])
                aim = np.append(aim, 0.0 if abs(apart) < SAME_CONSTANT else -CONSTANT_WEIGHT * apart)
        move, *_ = np.linalg.lstsq(weight @ unseen, aim - weight @ shift, rcond=None)
        shift = shift + unseen @ move
    return {name: float(each) for name, each, yes in zip(names, shift, judged, strict=True) if yes}


def shortened(plant: Plant, recordings: Sequence[Recording], rows: int) -> tuple[Recording, ...]:
    """Cut every recording in the same proportion, so that all have `rows` rows together; short ones stay."""
    total = sum(len(recording.time) for recording in recordings)
    if total <= rows:
        return tuple(recordings)
    names = [signal.name for signal in plant.outputs]
    cut = []
    for recording in recordings:
        keep = int(len(recording.time) * rows / total)
        places = np.unique(np.linspace(0, len(recording.time) - keep, STRETCH_PLACES).astype(int))
        lively = [
            sum(float(np.std(recording.columns[n][p : p + keep]) / np.std(recording.columns[n])) for n in names)
            for p in places
            if all(n in recording.columns and np.ptp(recording.columns[n]) > 0.0 for n in names)
        ]
        place = int(places[int(np.argmax(np.round(lively, 2)))]) if lively else 0
        columns = {name: column[place : place + keep] for name, column in recording.columns.items()}
        part = make_recording(recording.time[place : place + keep], columns, recording.source, recording.sha256)
        cut.append(replace(part, hold=recording.hold))
    return tuple(cut)

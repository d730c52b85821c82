"""Check recordings before anybody blames physics: clock, units, dead channels, and what they cannot test."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from firmloop.diagnose.policy import CLOCK_JUMP_ROWS, FEWEST_ROWS, HARDLY_MEANT, MISLABELLED_CORRELATION, SIGNLESS_NOISE
from firmloop.identify.error import IdentifyError
from firmloop.identify.fitting.own_values import by_itself, own_start, steps_apart
from firmloop.identify.fitting.sufficiency import dead_outputs
from firmloop.identify.plants.effects import effects
from firmloop.identify.plants.kinds import free_scale
from firmloop.identify.plants.plant import Plant
from firmloop.identify.recordings.recording import Recording
from firmloop.identify.recordings.stillness import moves
from firmloop.identify.simulation.at_rest import switched_on
from firmloop.identify.simulation.linear_filter import integrated
from firmloop.identify.simulation.simulate import course_of, drive_of, measured, simulator
from firmloop.identify.simulation.superset import comes_back

Array = NDArray[np.float64]

_FACTORS = {  # what readings are multiplied by in another unit
    "speed_rad_s": ((60.0 / (2.0 * np.pi), "rpm"), (2.0 * np.pi / 60.0, "something other than rad/s")),
    "current_A": ((1000.0, "mA"), (0.001, "kA")),
    "position_rad": ((180.0 / np.pi, "degrees"), (1.0 / (2.0 * np.pi), "turns")),
    "position_m": ((1000.0, "mm"), (0.001, "km")),
    "speed_m_s": ((1000.0, "mm/s"), (0.001, "km/s")),
}


@dataclass(frozen=True, slots=True)
class Preflight:
    """What was seen: remarks, the smallest noise each output can have, and effects that cannot be tested."""

    notes: tuple[str, ...]
    floors: Array  # (r,)
    untestable: Mapping[str, str]  # effect -> why


def preflight(plant: Plant, train: Sequence[Recording], test: Sequence[Recording]) -> Preflight:
    """Look at every recording; IdentifyError where a diagnosis would be a guess."""
    if not train:
        raise IdentifyError("recordings.train is empty; name at least one recording to diagnose")
    notes: list[str] = []
    known = {recording.sha256: recording.source for recording in train if recording.sha256}
    for recording in test:
        if recording.sha256 and recording.sha256 in known:
            raise IdentifyError(
                f"recordings.test: {recording.source} holds the same bytes as {known[recording.sha256]}; "
                f"what was fitted cannot judge the fit, so record another one"
            )
    if plant.kind == "ode" and not plant.balances:
        notes.append(
            "no derivative is known as a balance of torques, forces, voltages or flows, so nothing that acts there was "
            "looked for; name it in [plant.balances]"
        )
    notes += _constants_apart(plant)
    check_rows(plant, train, test)
    every = (*train, *test)
    for recording in every:
        notes += [*_held(plant, recording, every), *_clock(recording)]
        notes += _kinematics(recording)
    if all(by_itself(plant, each) and not moves(measured(plant, each)) for each in train):
        raise IdentifyError(
            f"{train[0].source}: column {plant.inputs[0].name} never changes, and nothing moves but for noise; physics "
            "shows in motion, so record steps or a sweep in both directions, or a decay from where the machine was held"
        )
    models = [_nominal(plant, recording) for recording in every]
    folded = _folded(plant, every, models)
    for recording, model in zip(every, models, strict=True):
        if model is not None:
            _check_units(plant, recording, model, folded)
    floors = _floors(plant, train)
    return Preflight(tuple(notes), floors, _untestable(plant, train))


def check_rows(plant: Plant, train: Sequence[Recording], test: Sequence[Recording]) -> None:
    """Refuse recordings too short, one whose time jumps, or in which an output stands still that should move."""
    every = (*train, *test)
    rows = sum(len(recording.time) for recording in train)
    if rows < FEWEST_ROWS:
        files = ", ".join(recording.source for recording in train)
        raise IdentifyError(
            f"{files}: has {rows} rows to train on; a diagnosis needs at least {FEWEST_ROWS}, better a thousand: "
            "record longer, or more often"
        )
    for recording in every:
        _check_time(recording)
    readings, drives = [measured(plant, each) for each in every], [drive_of(plant, each) for each in every]
    for count in (len(train), len(every)):  # what moves in a test recording alone teaches nothing
        for k, column in dead_outputs(readings[:count], drives[:count]):
            raise IdentifyError(
                f"{every[k].source}: column {plant.outputs[column].name} is {readings[k][0, column] + 0.0:g} in every "
                "row; check the sensor and its wire"
            )


def _check_time(recording: Recording) -> None:
    gaps = np.diff(recording.time)
    step = float(np.median(gaps))
    worst = int(np.argmax(gaps))
    if gaps[worst] > CLOCK_JUMP_ROWS * step:
        raise IdentifyError(
            f"{recording.source}: time_s jumps by {gaps[worst]:.4g} s after {recording.time[worst]:.6g} s "
            f"(usual step {step:.4g} s); cut the recording there into two files"
        )


def _constants_apart(plant: Plant) -> list[str]:
    """Tell a torque constant that is given far from the voltage constant: all torques are on its scale."""
    given = {each.name: each.value for each in plant.parameters if each.value > 0.0}
    torque, voltage = given.get("kt_N_m_A"), given.get("ke_V_s_rad")
    if torque is None or voltage is None or abs(np.log(torque / voltage)) < np.log(HARDLY_MEANT):
        return []
    return [
        f"kt_N_m_A is given as {torque:.4g} and ke_V_s_rad as {voltage:.4g}, which are one constant in SI units: "
        "torques and inertias are on the scale of the first; check both"
    ]


def _held(plant: Plant, recording: Recording, every: Sequence[Recording]) -> list[str]:
    """Tell inputs that never change: fine for a decay or a constant speed, and else a column that is not the input.

    Where those of other recordings stand at another level, each is a step that begins with its recording.
    """
    drive = drive_of(plant, recording)
    if np.any(np.ptp(drive, axis=0)) or any(steps_apart(plant, every)):
        return []
    pairs = zip(plant.inputs, course_of(plant, recording).drive[0], strict=True)
    said = f"{recording.source}: {', '.join(f'{one.name} is {value:g}' for one, value in pairs)} in every row"
    if not np.any(drive):
        return [f"{said}; what moves there is taken to move by itself"]
    begins = "from rest" if switched_on(plant, recording) else "where the readings say"
    return [
        f"{said}, so that the step itself is not in the file: it is taken to come with the first row, and what moves "
        f"to begin there {begins}; when it was switched on, and how fast, only a recording that begins before tells"
    ]


def _clock(recording: Recording) -> list[str]:
    gaps = np.diff(recording.time)
    step = float(np.median(gaps))
    late = gaps > 1.8 * step
    said = []
    if np.any(late):
        said.append(f"{recording.source}: {int(np.sum(late))} rows come late (longest step {gaps.max():.4g} s)")
    elif float(np.std(gaps)) > 0.02 * step:
        said.append(f"{recording.source}: the sample time jitters by {100.0 * float(np.std(gaps)) / step:.0f} % rms")
    return said


def _kinematics(recording: Recording) -> list[str]:
    """Compare the change of position with the integral of speed."""
    said = []
    for place, speed in (("position_rad", "speed_rad_s"), ("position_m", "speed_m_s")):
        if place not in recording.columns or speed not in recording.columns:
            continue
        moved = recording.columns[place] - recording.columns[place][0]
        summed = integrated(recording.columns[speed], recording.time)
        power = float(summed @ summed)
        if power > 0.0:
            factor = float(moved @ summed) / power
            if abs(factor - 1.0) > 0.05:
                said.append(
                    f"{recording.source}: {place} moves {factor:.3g} times as far as {speed} says; "
                    f"check the units and signs of both"
                )
    return said


def _nominal(plant: Plant, recording: Recording) -> Array | None:
    """Return the outputs (n, r) of the plant as given; None where it has no values or grows without bound."""
    constants = np.array([p.value for p in plant.parameters])
    if np.any(np.isnan(constants)):
        return None
    start = own_start(plant, recording, constants)
    simulated = simulator(plant, recording.hold).run(course_of(plant, recording), constants, start)
    return simulated if np.all(np.isfinite(simulated)) else None


def _folded(plant: Plant, recordings: Sequence[Recording], models: Sequence[Array | None]) -> frozenset[str]:
    """Return the outputs that are never negative where the plant goes both ways: that is no wrong sign."""
    found = set()
    for k, signal in enumerate(plant.outputs):
        real = np.concatenate([recording.columns[signal.name] for recording in recordings])
        model = np.concatenate([each[:, k] for each in models if each is not None] or [np.zeros(0)])
        if len(model) < len(real) or np.min(real) < -SIGNLESS_NOISE * np.max(real):
            continue
        top = SIGNLESS_NOISE * float(np.max(np.abs(model)))
        if np.max(model) > top and np.min(model) < -top and _alike(real, np.abs(model))[0] > MISLABELLED_CORRELATION:
            found.add(signal.name)
    return frozenset(found)


def _check_units(plant: Plant, recording: Recording, simulated: Array, folded: Collection[str]) -> None:
    """Hold each output against the nominal simulation (n, r): a fixed factor or a swap is no physics.

    What moves by itself begins where its readings say, of either sign, and tells of none.
    """
    values = measured(plant, recording)
    moved = [np.diff(values[:, k], prepend=values[0, k]) for k in range(values.shape[1])]
    ours = [np.diff(simulated[:, k], prepend=simulated[0, k]) for k in range(values.shape[1])]
    names, guessed = [signal.name for signal in plant.outputs], free_scale(plant) is not None
    driven = not by_itself(plant, recording)
    for k, name in enumerate(names):
        place = name.startswith("position")
        real, model = (moved[k], ours[k]) if place else (values[:, k], simulated[:, k])
        alike, factor = _alike(real, model)
        for other in range(len(names)):
            cross, ratio = _alike(values[:, other], simulated[:, k])
            if other != k and cross > max(MISLABELLED_CORRELATION, alike + 0.03) and 0.4 < ratio < 2.5:
                back = _alike(values[:, k], simulated[:, other])
                if back[0] > MISLABELLED_CORRELATION and 0.4 < back[1] < 2.5:
                    raise IdentifyError(
                        f"{recording.source}: columns {name} and {names[other]} look swapped (each follows the "
                        f"simulation of the other); map them in [recordings.rename]"
                    )
        if guessed:
            continue  # a value that is only a start says nothing of a sign or a unit
        if driven and alike < -MISLABELLED_CORRELATION and name not in folded:
            raise IdentifyError(
                f"{recording.source}: column {name} runs against the simulation (correlation {alike:.2f}); "
                f"check the sign of the sensor or of the drive"
            )
        for known, unit in _FACTORS.get(name, ()):
            if alike > MISLABELLED_CORRELATION and abs(np.log(factor / known)) < 0.3:
                raise IdentifyError(
                    f"{recording.source}: column {name} is {factor:.4g} times what the nominal plant does; it looks "
                    f"like {unit}. Convert the column, or correct the nominal parameters if it is right"
                )


def _alike(real: Array, model: Array) -> tuple[float, float]:
    """Return correlation, and how many times as large the recorded signal is."""
    one, other = real - np.mean(real), model - np.mean(model)
    sizes = float(np.linalg.norm(one)), float(np.linalg.norm(other))
    if min(sizes) == 0.0:
        return 0.0, 1.0
    return float(one @ other) / (sizes[0] * sizes[1]), sizes[0] / sizes[1]


def _floors(plant: Plant, train: Sequence[Recording]) -> Array:
    """Return a third of a resolution step's rms: no innovation can be smaller for long."""
    floors = []
    for signal in plant.outputs:
        steps = []
        for recording in train:
            jumps = np.abs(np.diff(np.unique(np.round(recording.columns[signal.name], 12))))
            steps.append(float(np.min(jumps)) if len(jumps) else 0.0)
        spread = float(np.std(np.concatenate([recording.columns[signal.name] for recording in train])))
        floors.append(max(min(steps) / np.sqrt(12.0) / 3.0, 1e-9 * spread, 1e-15))
    return np.array(floors)


def _untestable(plant: Plant, train: Sequence[Recording]) -> Mapping[str, str]:
    """Say which effects the regimes visited cannot show."""
    found: dict[str, str] = {}
    speeds = [recording.columns[name] for recording in train for name in recording.columns if name.startswith("speed_")]
    drives = np.concatenate([course_of(plant, recording).drive[:, 0] for recording in train])
    if speeds:
        every = np.concatenate(speeds)
        reach = float(np.max(np.abs(every)))
        if min(float(np.mean(every > 0.05 * reach)), float(np.mean(every < -0.05 * reach))) < 0.02:
            for effect in effects().values():
                if effect.regime == "reversal":
                    found[effect.name] = "the speed never reverses, so friction and a constant load look alike"
    if not comes_back(train):
        for effect in effects().values():
            if effect.regime == "way back":
                found[effect.name] = "the place is not read and never comes back, so that a spring looks like a drift"
    if float(np.max(np.abs(np.diff(drives)))) <= 0.02 * float(np.ptp(drives)):
        for effect in effects().values():
            if effect.regime == "quick input":
                found[effect.name] = "the input never changes fast"
    return found

"""Make the cases of the truth simulator: a folder a user could have made, and a label that diagnosis never opens."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench.diagnose.concealed import MACHINES, MIXED, OUTSIDE, SIZES, Concealed, Machine, effects_for
from bench.diagnose.truth import folded, read, run
from firmloop.identify.recordings.recording import make_recording, write_recording

Array = NDArray[np.float64]
STEP, ROWS = 1e-3, 5000
TAIL = 200  # rows that the truth goes on, for a clock that is fast
EXCITATIONS = ("steps", "prbs", "triangle", "chirp", "staircase", "mixed")
COLUMN = {
    True: {"current": "current_A", "speed": "speed_rad_s", "position": "position_rad"},
    False: {"speed": "speed_m_s", "position": "position_m"},
}
SENSORS = {
    True: (("speed", "current"), ("position", "current"), ("speed",)),
    False: (("position",), ("position", "speed"), ("speed",)),
}
STRATA = {"outside": 0.05, "null": 0.2, "triple": 0.33, "pair": 0.4, "single": 0.7}  # where the draw of a lot falls
RIVALS = (  # never concealed together: one contains the other, or is the same inside the noise
    {"coulomb_friction", "stribeck_friction", "asymmetric_friction", "presliding_friction"},
    {"flexible_coupling", "backlash"},
    {"load_torque", "load_step", "gravity_torque"},
    {"load_torque", "asymmetric_friction"},  # the same function of the data as a load and Coulomb friction,
    {"load_torque", "coulomb_friction"},  # which are asymmetric friction
    {"input_saturation", "slew_rate_limit"},
    {"input_delay", "sensor_delay", "clock_skew", "sensor_lag"},
)


@dataclass(frozen=True, slots=True)
class Case:
    """One draw; `hidden` is empty where nothing is concealed, `outside` names physics that no library holds."""

    seed: int
    machine: Machine
    sensors: tuple[str, ...]
    excitation: str
    closed: bool
    colored: bool
    size: float
    hidden: tuple[Concealed, ...]
    outside: str


def draw_case(seed: int, stratum: str = "any") -> Case:
    """Draw one case of a stratum, or of the published mixture: 20 % nothing, 10 % outside, 20 % several, 50 % one."""
    rng = np.random.default_rng([seed, 77])
    machine = MACHINES[int(rng.choice(len(MACHINES), p=(0.3, 0.3, 0.2, 0.2)))]
    sensors = SENSORS[machine.motor][int(rng.integers(3))]
    excitation, closed, colored = str(rng.choice(EXCITATIONS)), bool(rng.random() < 0.35), bool(rng.random() < 0.5)
    size, lot = float(rng.choice(SIZES)), rng.random()
    lot = STRATA.get(stratum, lot)
    hidden: tuple[Concealed, ...] = ()
    outside = ""
    if lot < 0.1:
        names = sorted(OUTSIDE if stratum == "outside" else MIXED)
        outside = str(rng.choice(names))
    elif lot >= 0.3:
        hidden = _several(machine, sensors, closed, size, rng, 1 if lot >= 0.5 else (2 if lot >= 0.367 else 3))
    return Case(seed, machine, sensors, excitation, closed, colored, size, hidden, outside)


def single_case(
    seed: int, name: str, machine: Machine, sensors: tuple[str, ...], excitation: str, colored: bool, size: float
) -> Case:
    """Return the case of one named effect, open loop; an empty name conceals nothing."""
    rng = np.random.default_rng([seed, 78])
    hidden = (effects_for(machine, sensors, False)[name](machine, size, rng, sensors),) if name else ()
    return Case(seed, machine, sensors, excitation, False, colored, size, hidden, "")


def _several(
    machine: Machine, sensors: tuple[str, ...], closed: bool, size: float, rng: np.random.Generator, count: int
) -> tuple[Concealed, ...]:
    draws = effects_for(machine, sensors, closed)
    while True:
        names = [str(name) for name in rng.choice(sorted(draws), count, replace=False)]
        if all(len(group & set(names)) <= 1 for group in RIVALS):
            break
    made = [draws[name](machine, size, rng, sensors) for name in names]
    touched = [each.sensor[0] for each in made if each.sensor] + [q for each in made for q in each.resolution]
    return tuple(made) if len(set(touched)) == len(touched) else _several(machine, sensors, closed, size, rng, count)


def excite(kind: str, rng: np.random.Generator) -> Array:
    """Return one drive (ROWS,) between -1 and 1."""
    time = np.arange(ROWS) * STEP
    if kind == "steps":
        return _held(rng, 250, lambda count: rng.uniform(-1.0, 1.0, count))
    if kind == "prbs":
        return np.asarray(0.9 * _held(rng, 40, lambda count: rng.choice([-0.8, 0.8], count) + rng.uniform(-0.2, 0.2)))
    if kind == "triangle":
        return np.asarray(
            rng.uniform(0.7, 1.0) * np.interp((time / rng.uniform(0.8, 1.6)) % 1, [0, 0.25, 0.75, 1], [0, 1, -1, 0])
        )
    if kind == "chirp":
        return np.asarray(rng.uniform(0.7, 1.0) * np.sin(2 * np.pi * (0.4 * time + rng.uniform(1.5, 3.0) * time**2)))
    if kind == "staircase":
        return _held(rng, 400, lambda count: np.sin(np.arange(count) * 2.4 + rng.uniform(0, 6)))
    parts = [excite(name, rng)[: ROWS // 5] for name in ("steps", "prbs", "triangle", "chirp", "staircase")]
    parts[4] = 0.2 * parts[4]
    return np.concatenate([parts[k] for k in rng.permutation(5)])


def _held(rng: np.random.Generator, length: int, draw: object) -> Array:
    count = 2 * ROWS // length + 2
    levels = np.asarray(draw(count)) if callable(draw) else np.zeros(count)
    lengths = rng.integers(length // 2, 3 * length // 2, count)
    held = np.repeat(levels, lengths)
    return np.asarray(held[:ROWS] if len(held) >= ROWS else np.resize(held, ROWS))


def write_case(case: Case, folder: Path, labels: Path) -> None:
    """Write project and recordings to `folder`, the label and the noise-free recordings to `labels`."""
    label = write_recordings(case, folder, labels, ("train", "test"))
    (labels / "label.json").write_text(json.dumps(label, indent=1), encoding="utf-8")


def write_recordings(case: Case, folder: Path, labels: Path, roles: Sequence[str]) -> Mapping[str, Any]:
    """Write project and one recording a role to `folder`, noise-free ones to `labels`; return the label.

    The noise-free ones are neither rounded nor wrapped, which no fit to them could follow. A role that begins with
    "test" is a test recording, all others are train.
    """
    folder.mkdir(parents=True, exist_ok=True)
    labels.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng([case.seed, 79])
    truth = true_values(case)
    noise: dict[str, list[float]] = {}
    for role in roles:
        for name, rms in _write_recording(case, truth, role, folder, labels, rng).items():
            noise.setdefault(name, []).append(rms)
    (folder / "project.toml").write_text(_project(case, truth, rng, roles), encoding="utf-8")
    return {
        "effects": {each.name: _told(case.machine, each) for each in case.hidden},
        "outputs": {each.name: _column(case, each) for each in case.hidden},
        "plant": nominal(case.machine, truth),
        "outside": case.outside,
        "machine": case.machine.name,
        "sensors": list(case.sensors),
        "excitation": case.excitation,
        "closed": case.closed,
        "colored": case.colored,
        "size": case.size,
        "noise": {name: float(np.sqrt(np.mean(np.square(values)))) for name, values in noise.items()},
        "noise_of_test": {name: values[-1] for name, values in noise.items()},
    }


def true_values(case: Case) -> dict[str, float]:
    """Return what moves the truth: the machine's constants and what is concealed."""
    truth = {**case.machine.values, "is_motor": float(case.machine.motor)}
    if not case.machine.motor:
        truth.update({"kt": 1.0, "ke": 1.0, "R": 1.0, "L": 1.0})
    for each in case.hidden:
        truth.update(each.truth)
    if case.outside:
        truth.update(OUTSIDE[case.outside](case.machine, case.size))
    return truth


def _told(machine: Machine, each: Concealed) -> Mapping[str, float]:
    """Return what is concealed as the contract calls it: a stage has forces and masses."""
    words = {} if machine.motor else {"torque": "force", "load_inertia": "load_mass"}
    return {words.get(word, word): value for word, value in each.told.items()}


def _write_recording(
    case: Case, truth: Mapping[str, float], role: str, folder: Path, labels: Path, rng: np.random.Generator
) -> Mapping[str, float]:
    machine = case.machine
    drive = excite(case.excitation, rng)
    drive[:20] = 0.0
    gains, command = None, drive * machine.top
    if case.closed:
        reach = machine.speed if machine.motor else machine.speed * 0.5
        stiff = machine.top / reach * 2.0
        gains, command = np.array([stiff, stiff * 8.0, machine.top]), drive * reach * 0.7
    command = np.concatenate([command, np.full(TAIL, command[-1])])
    torque = np.zeros(ROWS + TAIL)
    if case.colored:
        keep = np.exp(-STEP / 0.05)
        steps = rng.normal(0.0, 0.004 * machine.effort * np.sqrt(1.0 - keep**2), ROWS + TAIL)
        for k in range(1, ROWS + TAIL):
            torque[k] = keep * torque[k - 1] + steps[k]
    applied, fine = run(truth, command, STEP, gains, torque)
    _, still = run(truth, applied, STEP, None, np.zeros(ROWS + TAIL))
    columns, clean = {_input(machine): applied[:ROWS]}, {_input(machine): applied[:ROWS]}
    noise = {}
    for quantity in case.sensors:
        name = COLUMN[machine.motor][quantity]
        faults = [each.sensor[1] for each in case.hidden if each.sensor and each.sensor[0] == quantity]
        skew = sum(each.skew for each in case.hidden)
        fault = faults[0] if faults else None
        shown = read(quantity, fine, STEP, ROWS, fault, skew)
        reach = fault.size["range"] if fault and fault.fault == "sensor_wrap" else np.inf
        clean[name] = read(quantity, still, STEP, ROWS, fault if reach == np.inf else None, skew)
        shown = shown + _sensor_noise(machine, quantity, rng)
        steps_of = [each.resolution[quantity] for each in case.hidden if quantity in each.resolution]
        fine_step = steps_of[0] if steps_of else _resolution(machine, quantity)
        columns[name] = np.round(shown / fine_step) * fine_step
        away = columns[name] - clean[name]
        noise[name] = float(np.std(away if reach == np.inf else folded(away, reach)))
    time = np.arange(ROWS) * STEP
    write_recording(make_recording(time, columns, role, ""), folder / f"{role}.csv")
    write_recording(make_recording(time, clean, role, ""), labels / f"{role}.csv")
    return noise


def _column(case: Case, hidden: Concealed) -> str | None:
    """Return the column that an effect of a sensor is in; None for all others."""
    quantity = hidden.sensor[0] if hidden.sensor else next(iter(hidden.resolution), None)
    return None if quantity is None else COLUMN[case.machine.motor][quantity]


def _input(machine: Machine) -> str:
    return "voltage_V" if machine.motor else "force_N"


def _sensor_noise(machine: Machine, quantity: str, rng: np.random.Generator) -> Array:
    size = {"current": 0.006 * machine.stall, "speed": 0.004 * machine.speed, "position": 0.0}[quantity]
    return np.asarray(rng.normal(0.0, 1.0, ROWS) * size)


def _resolution(machine: Machine, quantity: str) -> float:
    if quantity == "position":
        return 2.0 * np.pi / 4096 if machine.motor else 5e-6
    return 0.002 * (machine.stall if quantity == "current" else machine.speed)


def _project(case: Case, truth: Mapping[str, float], rng: np.random.Generator, roles: Sequence[str]) -> str:
    """Give nominal parameters that are off by up to 10 %, all free."""
    machine = case.machine
    lines = [
        "schema = 1",
        'name = "blind"',
        "[recordings]",
        *(f"{part} = {json.dumps(files)}" for part, files in _parts(roles).items()),
        "[plant]",
        f'kind = "{"dc_motor" if machine.motor else "linear_stage"}"',
        f'input = "{_input(machine)}"',
        f"outputs = {json.dumps([COLUMN[machine.motor][quantity] for quantity in case.sensors])}",
        "[plant.parameters]",
    ]
    for name, true in nominal(machine, truth).items():
        held = name in held_still(case.sensors, machine)  # what is not free is known: it may not hide a mismatch
        value = true * (1.0 if held else rng.uniform(0.9, 1.1))
        lines.append(f"{name} = {{ value = {value!r}, free = {'false' if held else 'true'} }}")
    return "\n".join(lines) + "\n"


def _parts(roles: Sequence[str]) -> Mapping[str, Sequence[str]]:
    """Return the files of train and test; a part without any is left out."""
    tests = [f"{role}.csv" for role in roles if role.startswith("test")]
    trains = [f"{role}.csv" for role in roles if not role.startswith("test")]
    return {"train": trains, **({"test": tests} if tests else {})}


def nominal(machine: Machine, truth: Mapping[str, float]) -> Mapping[str, float]:
    """Return the true nominal parameters as the contract calls them; the inertia is that of all that turns."""
    rigid = truth["J"] + truth.get("coupled_inertia", 0.0)
    if machine.motor:
        keys = {"R_ohm": "R", "L_H": "L", "ke_V_s_rad": "ke", "kt_N_m_A": "kt", "J_kg_m2": "", "b_N_m_s_rad": "b"}
    else:
        keys = {"mass_kg": "", "b_N_s_m": "b"}
    return {name: machine.values[key] if key else rigid for name, key in keys.items()}


def held_still(sensors: Sequence[str], machine: Machine) -> tuple[str, ...]:
    """Return the parameters no user would leave free with these sensors: nothing in the data can tell them."""
    return () if "current" in sensors or not machine.motor else ("L_H", "kt_N_m_A", "R_ohm")

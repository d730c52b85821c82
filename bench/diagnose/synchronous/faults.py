"""Conceal what limits a spindle in logs of its drive, and let `firmloop diagnose` find it.

    python -m bench.diagnose.synchronous.faults [NAME ...] [--seeds FIRST LAST]

Each case is a project as a user writes it, without the effect, its free parameters up to a tenth off, and two logs of
80 ms at 20 kHz: steps and random switching, by `truth.py`, with noise of 0.02 A rms on the currents,
0.5 rad/s and 1 mrad. Even seeds log currents along the axes of the drive, odd ones those of two phases. `nothing`
conceals nothing.
"""

from __future__ import annotations

import argparse
import json
import math
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Mapping
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench.diagnose.synchronous.truth import COLUMNS, SPINDLE, STEP, Machine
from firmloop.cli import main as firmloop

Array = NDArray[np.float64]
ROWS = 1600
NOISE = dict(zip(COLUMNS, (0.02, 0.02, 0.02, 0.02, 0.5, 1e-3), strict=True))  # A, rad/s, rad
LOGGED = (
    ("current_d_A", "current_q_A", "speed_rad_s", "position_rad"),
    ("current_a_A", "current_b_A", "speed_rad_s", "position_rad"),
)
OFF = 0.1  # of what is given


def _between(rng: np.random.Generator, low: float, high: float) -> float:
    return low * (high / low) ** float(rng.random())


def _signed(rng: np.random.Generator, low: float, high: float) -> float:
    return float(rng.choice([-1.0, 1.0])) * _between(rng, low, high)


def _wave(rng: np.random.Generator, size: float) -> tuple[float, float, float]:
    return size, float(rng.choice([12.0, 24.0, 36.0])), float(rng.uniform(-math.pi, math.pi))


# What is concealed; the names that say it, in a log of axes and in one of phases.
CASES: Mapping[str, tuple[Callable[[np.random.Generator], Machine], str, str]] = {
    "nothing": (lambda rng: Machine(), "", ""),
    "dead_time": (lambda rng: Machine(dead=_between(rng, 0.15, 0.6)), "dead_time", "dead_time"),
    "cogging": (
        lambda rng: Machine(cogging=_wave(rng, _between(rng, 5e-3, 2e-2))),
        "cogging_torque",
        "cogging_torque",
    ),
    "ripple": (
        lambda rng: Machine(ripple=_wave(rng, _between(rng, 0.05, 0.2))),
        "torque_ripple",
        "torque_ripple",
    ),
    "harmonics": (
        lambda rng: Machine(wave=_wave(rng, _between(rng, 5e-4, 2e-3))),
        "flux_harmonics",
        "flux_harmonics",
    ),
    "current_offset": (
        lambda rng: Machine(offset=(_signed(rng, 0.1, 0.4), 0.0)),
        "current_offset",
        "sensor_offset",
    ),
    "current_gain": (lambda rng: Machine(gain=(1.0 + _signed(rng, 0.03, 0.1), 1.0)), "current_gain", "sensor_gain"),
    "angle": (lambda rng: Machine(angle=_signed(rng, 0.05, 0.3)), "angle_offset", "angle_offset"),
    "rocking": (
        lambda rng: Machine(rocking=(_between(rng, 0.02, 0.1), float(rng.uniform(-math.pi, math.pi)))),
        "angle_eccentricity",
        "angle_eccentricity",
    ),
    "magnets": (
        lambda rng: Machine(heat=(_between(rng, 0.5, 2.0), _between(rng, 0.02, 0.1))),
        "magnet_heating",
        "magnet_heating",
    ),
    "saturation": (lambda rng: Machine(knee=_between(rng, 15.0, 40.0)), "stator_saturation", "stator_saturation"),
    "friction": (lambda rng: Machine(dry=_between(rng, 2e-3, 1e-2)), "coulomb_friction", "coulomb_friction"),
    "drag": (lambda rng: Machine(drag=_between(rng, 1e-6, 1e-5)), "quadratic_drag", "quadratic_drag"),
    "load": (
        lambda rng: Machine(load=(_signed(rng, 1e-2, 4e-2), float(rng.uniform(0.02, 0.06)))),
        "load_step",
        "load_step",
    ),
}


def voltages(rng: np.random.Generator) -> tuple[Array, Array]:
    """Return v_d and v_q (n, 2) of both logs."""
    made = []
    for rows, along, across in ((160, (0, 1, -1), (0, 4, 7, 2, -5, -8, 3)), (40, (-1, 1), (-5, 7))):
        count = ROWS // rows
        levels = np.column_stack([rng.choice(along, count), rng.choice(across, count)]).astype(np.float64)
        made.append(np.repeat(levels, rows, axis=0))
    return made[0], made[1]


def project(machine: Machine, outputs: tuple[str, ...], rng: np.random.Generator, folder: Path) -> Path:
    """Write the logs and the project; return the project's file."""
    files = []
    for number, driven in enumerate(voltages(rng)):
        seen = machine.run(driven)
        shown = [seen[name] + rng.normal(size=ROWS) * NOISE[name] for name in outputs]
        head = ",".join(["time_s", "voltage_d_V", "voltage_q_V", *outputs])
        files.append(f"log{number + 1}.csv")
        table = np.column_stack([np.arange(ROWS) * STEP, driven, *shown])
        np.savetxt(folder / files[-1], table, fmt="%.6g", delimiter=",", header=head, comments="")
    lines = ["schema = 1", 'name = "concealed"', "[recordings]", f"train = {json.dumps(files)}", "[plant]"]
    lines += ['kind = "pmsm"', 'inputs = ["voltage_d_V", "voltage_q_V"]', f"outputs = {json.dumps(outputs)}"]
    lines += ["[plant.parameters]", f"pole_pairs = {SPINDLE['pole_pairs']:g}"]
    for name, value in SPINDLE.items():
        if name != "pole_pairs":
            lines.append(f"{name} = {{ value = {value * (1.0 + rng.uniform(-OFF, OFF)):.6g}, free = true }}")
    file = folder / "project.toml"
    file.write_text("\n".join([*lines, ""]), encoding="utf-8")
    return file


def diagnosed(name: str, seed: int) -> tuple[Machine, Mapping[str, Any]]:
    """Conceal, run the command, return what was concealed and what it wrote."""
    rng = np.random.default_rng([seed, 38])
    machine = CASES[name][0](rng)
    with tempfile.TemporaryDirectory() as where:
        folder, said = Path(where), StringIO()
        file = project(machine, LOGGED[seed % 2], rng, folder)
        with redirect_stdout(said), redirect_stderr(said):
            firmloop(["diagnose", str(file), "--out", str(folder / "out")])
        document = folder / "out" / "diagnosis.json"
        if not document.is_file():
            return machine, {"verdict": "refused", "effects": [], "said": said.getvalue()}
        found = json.loads(document.read_text(encoding="utf-8"))
    assert isinstance(found, dict)
    return machine, found


def judged(sought: str, found: Mapping[str, Any]) -> str:
    """Return exact, among others, unknown, missed or wrong."""
    told = [effect["name"] for effect in found["effects"]]
    if told == ([sought] if sought else []) and found["verdict"] in ("explained", "no_mismatch"):
        return "exact"
    if found["verdict"] == "ambiguous" and sought in told:
        return "among others"
    return {"unknown_physics": "unknown", "no_mismatch": "missed"}.get(str(found["verdict"]), "wrong")


def main() -> None:
    """Print one line a case, and how many of each."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", choices=[[], *CASES], default=[])
    parser.add_argument("--seeds", type=int, nargs=2, default=(0, 3))
    asked = parser.parse_args()
    total: Counter[str] = Counter()
    for name in asked.names or CASES:
        for seed in range(asked.seeds[0], asked.seeds[1] + 1):
            begun = time.process_time()
            machine, found = diagnosed(name, seed)
            verdict = judged(CASES[name][1 + seed % 2], found)
            total[verdict] += 1
            told = [(each["name"], each["parameters"].items()) for each in found["effects"]]
            values = [" ".join([effect, *(f"{key} {_value(one)}" for key, one in own)]) for effect, own in told]
            hidden = {key: value for key, value in _shown(machine).items() if value != _shown(Machine())[key]}
            print(
                f"{name:15} {seed:3} {verdict:13} {'; '.join(values) or found['verdict']}  truth {hidden}"
                f"  {time.process_time() - begun:.0f} s {found.get('said', '')}",
                flush=True,
            )
    print(", ".join(f"{count} {verdict}" for verdict, count in total.most_common()))


def _value(parameter: Mapping[str, Any]) -> str:
    return f"{parameter['value']:.4g}"


def _shown(machine: Machine) -> dict[str, Any]:
    return {name: getattr(machine, name) for name in Machine.__slots__}


if __name__ == "__main__":
    main()

"""Conceal what limits the motor studies in recordings of an induction motor, and let `firmloop diagnose` find it.

    python -m bench.induction_faults [NAME ...]

Each case is a project as a user writes it, without the effect, and a recording by `bench/induction_truth.py`, a start
at 1 kHz, with noise: 0.3 A rms on both currents (0.3 % of the start's) and 0.5 rad/s on the speed. Exit status 1 where
a verdict is not the effect alone, or its value is further than a tenth from the truth.
"""

from __future__ import annotations

import json
import sys
import tempfile
import time
from collections.abc import Mapping
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np

from bench.induction_truth import Motor
from firmloop.cli import main as firmloop

NOISE = (0.5, 0.3, 0.3)  # rad/s, A, A
STEP = 1e-3  # s
ON = 0.05  # s: three periods of the mains
FREE = ("rotor_R_ohm", "J_kg_m2")
VALUES = {
    "main_R_ohm": 0.525,
    "main_L_H": 1.4e-3,
    "aux_R_ohm": 1.17,
    "aux_L_H": 5.0e-3,
    "rotor_R_ohm": 0.68,
    "rotor_L_H": 1.4e-3,
    "magnetizing_L_H": 0.062,
    "turns_ratio": 1.8,
    "pole_pairs": 2.0,
    "capacitance_F": 340e-6,
    "switch_open_rad_s": 140.0,
    "switch_close_rad_s": 80.0,
    "J_kg_m2": 0.055,
    "b_N_m_s_rad": 1e-4,
    "load_N_m_s2_rad2": 4e-5,
    "rise_K_per_W": 0.0,
    "heating_time_s": 1000.0,
    "frequency_Hz": 60.0,
}


@dataclass(frozen=True, slots=True)
class Case:
    """What is concealed, as the truth takes it; what is to be named, with the parameter that is judged."""

    concealed: Mapping[str, Any]
    parameter: str
    value: float
    seconds: float
    off: float = np.inf  # s: when the supply is taken off
    changed: Mapping[str, float] | None = None  # constants other than VALUES, known to the project


CASES = {
    "magnetizing_saturation": Case({"knee": 10.0}, "current_A", 10.0, 0.7),
    "coulomb_friction": Case({"dry": 3.0}, "torque_N_m", 3.0, 1.4, off=0.5),
    "load_step": Case({"load": (6.0, 0.7037)}, "torque_N_m", 6.0, 1.1),
    "capacitor_ageing": Case({"lost": 0.1}, "loss", 0.1, 0.5),
    # A load that the motor cannot bring up to speed: the winding heats far beyond the rated 62 K.
    "resistance_heating": Case(
        {"heat": (0.06, 1.5)}, "rise_K_per_W", 0.06, 2.0, changed={"load_N_m_s2_rad2": 0.02}
    ),
}  # fmt: skip


def project(case: Case, folder: Path) -> Path:
    """Write recording and project; return the project's file."""
    time_s = np.arange(round(case.seconds / STEP)) * STEP
    volts = np.where((time_s >= ON) & (time_s < case.off), 115.0, 0.0)
    values = {**VALUES, **(case.changed or {})}
    rows = Motor(values, **case.concealed).run(time_s, volts)
    rows += np.random.default_rng(1).normal(size=rows.shape) * NOISE
    table = np.column_stack([time_s, volts, rows])
    head = "time_s,voltage_rms_V,speed_rad_s,main_current_A,aux_current_A"
    np.savetxt(folder / "start.csv", table, fmt="%.7g", delimiter=",", header=head, comments="")
    lines = ["schema = 1", 'name = "l3510"', "[recordings]", 'train = ["start.csv"]', "[plant]"]
    lines += ['kind = "single_phase_induction_motor"', 'input = "voltage_rms_V"']
    lines += ['outputs = ["speed_rad_s", "main_current_A", "aux_current_A"]', "[plant.parameters]"]
    lines += [f"{key} = {{ value = {value!r}, free = {str(key in FREE).lower()} }}" for key, value in values.items()]
    file = folder / "project.toml"
    file.write_text("\n".join([*lines, ""]), encoding="utf-8")
    return file


def diagnosed(case: Case) -> tuple[int, Mapping[str, Any]]:
    """Conceal, run the command, return its exit status and what it wrote."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        file, said = project(case, folder), StringIO()
        with redirect_stdout(said), redirect_stderr(said):
            status = firmloop(["diagnose", str(file), "--out", str(folder / "out")])
        written = folder / "out" / "diagnosis.json"
        if not written.is_file():
            raise SystemExit(said.getvalue())
        found = json.loads(written.read_text(encoding="utf-8"))
    assert isinstance(found, dict)
    return status, found


def main() -> int:
    """Print one line a case."""
    print(
        "concealed               verdict           named                     judged by     truth   found  95 % interval"
        "      s"
    )
    missed = 0
    for name in sys.argv[1:] or CASES:
        case, begun = CASES[name], time.process_time()
        status, found = diagnosed(case)
        took = time.process_time() - begun
        named = [effect["name"] for effect in found["effects"]]
        value: Mapping[str, Any] = {"value": np.nan, "ci95": [np.nan, np.nan]}
        if name in named:
            value = found["effects"][named.index(name)]["parameters"][case.parameter]
        low, high = value["ci95"] or (np.nan, np.nan)
        print(
            f"{name:23} {found['verdict']:17} {', '.join(named):25} {case.parameter:12} {case.value:>6.4g} "
            f"{value['value']:>7.4g}   {low:.4g} to {high:.4g} {took:>6.0f}",
            flush=True,
        )
        near = abs(value["value"] / case.value - 1.0) < 0.1
        missed += not (status == 1 and named == [name] and near)
    return int(missed > 0)


if __name__ == "__main__":
    sys.exit(main())

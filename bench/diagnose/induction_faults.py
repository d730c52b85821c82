"""Conceal what limits the motor studies in recordings of their motors, and let `firmloop diagnose` find it.

    python -m bench.diagnose.induction_faults [NAME ...]

Each case is a project as a user writes it, without the effect, and a recording at 1 kHz. The induction motor starts, by
`induction_truth.py`, with noise of 0.3 A rms on both currents (0.3 % of the start's) and 0.5 rad/s on the speed. The DC
motor swings a wheel to and fro, by `truth.c`, with noise of 1 mA and 0.5 rad/s. Exit status 1 where a verdict is not
the effect alone, or its value is further than a tenth from the truth.
"""

from __future__ import annotations

import json
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench import named
from bench.diagnose import truth
from bench.diagnose.induction_truth import L3510, Motor
from firmloop.cli import main as firmloop

NOISE = (0.5, 0.3, 0.3)  # rad/s, A, A
STEP = 1e-3  # s
ON = 0.05  # s: three periods of the mains
NOISE_DC = (0.5, 1e-3)  # rad/s, A
WHEEL = {"R": 24.5, "L": 5e-4, "ke": 0.0136, "kt": 0.0136, "J": 2e-6, "b": 2e-6}
FREE = ("rotor_R_ohm", "J_kg_m2")


@dataclass(frozen=True, slots=True)
class Case:
    """What is concealed, as the truth takes it; what is to be named, with the parameter that is judged.

    In a wheel on a DC motor, as `bench/diagnose/truth.c` takes it, or in an induction motor.
    """

    concealed: Mapping[str, Any]
    parameter: str
    value: float
    seconds: float
    off: float = np.inf  # s: when the supply is taken off
    changed: Mapping[str, float] | None = None  # constants other than L3510, known to the project
    wheel: bool = False


CASES: Mapping[str, Case] = {
    "magnetizing_saturation": Case({"knee": 10.0}, "current_A", 10.0, 0.7),
    "coulomb_friction": Case({"dry": 3.0}, "torque_N_m", 3.0, 1.4, off=0.5),
    "load_step": Case({"load": (6.0, 0.7037)}, "torque_N_m", 6.0, 1.1),
    "capacitor_ageing": Case({"lost": 0.1}, "loss", 0.1, 0.5),
    # A load that the motor cannot bring up to speed: the winding heats far beyond the rated 62 K.
    "resistance_heating": Case(
        {"heat": (0.06, 1.5)}, "rise_K_per_W", 0.06, 2.0, changed={"load_N_m_s2_rad2": 0.02}
    ),
    # Some 3 W in a small motor's winding: 60 K after two seconds.
    "resistance_heating, dc": Case({"heat_rise": 20.0, "heat_time": 1.5}, "rise_K_per_W", 20.0, 4.0, wheel=True),
}  # fmt: skip


def project(case: Case, folder: Path) -> Path:
    """Write recording and project; return the project's file."""
    return swung(case, folder) if case.wheel else started(case, folder)


def swung(case: Case, folder: Path) -> Path:
    """Write those of a DC motor that reverses before it has come up to speed."""
    time_s = np.arange(round(case.seconds / STEP)) * STEP
    volts = np.where(time_s % 0.4 < 0.2, 12.0, -12.0)
    names = {"R": "R_ohm", "L": "L_H", "ke": "ke_V_s_rad", "kt": "kt_N_m_A", "J": "J_kg_m2", "b": "b_N_m_s_rad"}
    given = {**WHEEL, **case.concealed, "is_motor": 1.0}
    _, fine = truth.run(given, volts, STEP, None, np.zeros(len(volts)))
    rows = np.stack([truth.read(name, fine, STEP, len(volts), None, 0.0) for name in ("speed", "current")], axis=1)
    rows += np.random.default_rng(1).normal(size=rows.shape) * NOISE_DC
    values = {names[key]: value for key, value in WHEEL.items()}
    free = ("R_ohm", "ke_V_s_rad", "J_kg_m2", "b_N_m_s_rad")
    wires = ("speed_rad_s", "current_A")
    return written(folder, "dc_motor", "voltage_V", wires, np.column_stack([time_s, volts, rows]), values, free)


def started(case: Case, folder: Path) -> Path:
    """Write those of an induction motor's start."""
    time_s = np.arange(round(case.seconds / STEP)) * STEP
    volts = np.where((time_s >= ON) & (time_s < case.off), 115.0, 0.0)
    values = {**L3510, **(case.changed or {})}
    rows = Motor(values, **case.concealed).run(time_s, volts)
    rows += np.random.default_rng(1).normal(size=rows.shape) * NOISE
    wires = ("speed_rad_s", "main_current_A", "aux_current_A")
    table, kind = np.column_stack([time_s, volts, rows]), "single_phase_induction_motor"
    return written(folder, kind, "voltage_rms_V", wires, table, values, FREE)


def written(
    folder: Path,
    kind: str,
    drive: str,
    outputs: Sequence[str],
    table: NDArray[np.float64],
    values: Mapping[str, float],
    free: Sequence[str],
) -> Path:
    """Write a recording and the project that names it."""
    head = ",".join(["time_s", drive, *outputs])
    np.savetxt(folder / "start.csv", table, fmt="%.7g", delimiter=",", header=head, comments="")
    lines = ["schema = 1", 'name = "concealed"', "[recordings]", 'train = ["start.csv"]', "[plant]"]
    lines += [f'kind = "{kind}"', f'input = "{drive}"', f"outputs = {json.dumps(outputs)}", "[plant.parameters]"]
    lines += [f"{key} = {{ value = {value!r}, free = {str(key in free).lower()} }}" for key, value in values.items()]
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
        document = folder / "out" / "diagnosis.json"
        if not document.is_file():
            raise SystemExit(said.getvalue())
        found = json.loads(document.read_text(encoding="utf-8"))
    assert isinstance(found, dict)
    return status, found


def main() -> int:
    """Print one line a case."""
    print(
        "concealed               verdict           named                     judged by     truth   found  95 % interval"
        "      s"
    )
    missed = 0
    for name in named(sys.argv[1:], CASES, "case"):
        case, begun = CASES[name], time.process_time()
        status, found = diagnosed(case)
        took = time.process_time() - begun
        told, sought = [effect["name"] for effect in found["effects"]], name.partition(",")[0]
        value: Mapping[str, Any] = {"value": np.nan, "ci95": [np.nan, np.nan]}
        if sought in told:
            value = found["effects"][told.index(sought)]["parameters"][case.parameter]
        low, high = value["ci95"] or (np.nan, np.nan)
        print(
            f"{name:23} {found['verdict']:17} {', '.join(told):25} {case.parameter:12} {case.value:>6.4g} "
            f"{value['value']:>7.4g}   {low:.4g} to {high:.4g} {took:>6.0f}",
            flush=True,
        )
        near = abs(value["value"] / case.value - 1.0) < 0.1
        missed += not (status == 1 and told == [sought] and near)
    return int(missed > 0)


if __name__ == "__main__":
    sys.exit(main())

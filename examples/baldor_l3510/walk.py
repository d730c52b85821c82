"""Take the study's whole way in one command: starts to G1, G2, controllers and C, then the capacitor monitor.

    python -m examples.baldor_l3510.walk --out out/l3510

Each project is run by firmloop's own command into a folder of its own; then the monitor's program, bit for bit what its
C computes, watches starts of the bench's motor (bench.py) with a whole and with an aged capacitor.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from examples.baldor_l3510 import bench
from firmloop.cli import main as firmloop
from firmloop.design.kinds import design
from firmloop.project.project import read_project
from firmloop.quantize.lower.lower import lower
from firmloop.quantize.program import Program
from firmloop.verify.reference import run
from firmloop.verify.scaling import to_physical, to_raw

HERE = Path(__file__).parent
PROJECTS = (("run", "l3510_g1"), ("run", "l3510_g2"), ("verify", "start_monitor"))
SHARES = (1.0, 0.95, 0.9, 0.85)  # of the rated capacitance


def monitor() -> tuple[Program, float]:
    """Return the exact program of start_monitor.toml, and the inductance (H) of its circuit."""
    project = read_project(HERE / "start_monitor.toml")
    part = project.controller
    assert part is not None
    inputs, outputs = project.controller_inputs, project.controller_outputs
    law = design(part.kind, project.name, part.settings, part.period, inputs, outputs, None).law
    return lower(law, "float32"), float(str(part.settings["inductance_H"]))


def watched(program: Program, one: bench.Start) -> tuple[NDArray[np.float64], bool, float]:
    """Return the last outputs for a start, whether the capacitor is flagged, and when the start ended, s."""
    columns = (one.voltage, one.aux_current, one.speed)
    raw = [to_raw(value, column) for value, column in zip(program.inputs, columns, strict=True)]
    trace = run(program, np.stack(raw, axis=-1)[None])
    last = [to_physical(value, trace.outputs[0, -1:, k])[0] for k, value in enumerate(program.outputs)]
    bits = {bit.name: trace.status[0] >> bit.bit & 1 for bit in program.status}
    return (
        np.array(last),
        bool(bits["capacitor_low"][-1]),
        float(np.flatnonzero(bits["starting"])[-1] + 1) * bench.PERIOD,
    )


def table() -> str:
    """Watch one start of each capacitor."""
    program, inductance = monitor()
    lines = [
        "| capacitor | found | natural frequency | damping ratio | flagged | start ends | switch opened |",
        "|---|---|---|---|---|---|---|",
    ]
    for k, share in enumerate(SHARES):
        one = bench.start(np.random.default_rng(bench.SEED + k), share * bench.CAPACITANCE)
        (natural, half, damping), low, ended = watched(program, one)
        lines.append(
            f"| {1e6 * share * bench.CAPACITANCE:.0f} uF | {1e6 / (inductance * natural**2):.0f} uF "
            f"| {natural:.1f} ± {half:.1f} rad/s | {damping:.3f} | {'low' if low else 'no'} "
            f"| {ended:.3f} s | {one.opened:.3f} s |"
        )
    return "\n".join([*lines, ""])


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the projects and print the table; the exit code is the first that is not 0."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", required=True, help="folder of the results, one inside for each project")
    out = Path(parser.parse_args(arguments).out)
    codes = [firmloop([verb, str(HERE / f"{name}.toml"), "--out", str(out / name)]) for verb, name in PROJECTS]
    print(table(), end="")
    return next((code for code in codes if code), 0)


if __name__ == "__main__":
    raise SystemExit(main())

"""Close the loop on the emulated controller and on the host's, 100,000 steps each: `python -m bench.links.closed_loop`.

The exit status is the number of runs that are not the same to the last bit.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path

import numpy as np

from firmloop.codegen.emit import emit
from firmloop.codegen.firmware import firmware
from firmloop.codegen.target import load_target
from firmloop.identify.plants.kinds import make_plant
from firmloop.identify.plants.plant import Plant
from firmloop.quantize.lower.lower import lower
from firmloop.verify.build.host import build_host
from firmloop.verify.build.image import build_image
from firmloop.verify.links.library import LibraryLink
from firmloop.verify.links.opener import openers
from firmloop.verify.proofs.closed_loop import PlantLoop, close_loop
from tests.laws import FULL, pid

ROLES = ("reference", "measurement")


def wheel() -> Plant:
    """A small DC motor, as in the example."""
    values = {"R_ohm": 8.0, "L_H": 1e-3, "ke_V_s_rad": 0.02, "kt_N_m_A": 0.02, "J_kg_m2": 3e-6, "b_N_m_s_rad": 3e-6}
    table = {name: {"value": value, "free": False} for name, value in values.items()}
    return make_plant("dc_motor", "voltage_V", ["speed_rad_s"], table)


def staircase(steps: int) -> np.ndarray:
    """References in rad/s: a new one every 500 steps, within the range."""
    levels = np.random.default_rng(1).uniform(-300.0, 300.0, size=steps // 500 + 1)
    return np.repeat(levels, 500)[:steps]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--steps", type=int, default=100_000)
    parser.add_argument("--target", action="append")
    arguments = parser.parse_args()
    wrong, reference = 0, staircase(arguments.steps)
    loop = PlantLoop(wheel(), reference, ROLES)
    for number in ("float32", "fixed32", "fixed16"):
        program = lower(pid(FULL), number)
        bundle = emit(program, "firmloop generate bench.toml")
        host = LibraryLink(build_host(bundle, load_target("host")), program)
        expected = close_loop(program, loop, host)
        for name in arguments.target or ["qemu_mps2_an386"]:
            target = load_target(name)
            with tempfile.TemporaryDirectory() as folder:
                image = build_image(firmware(program, bundle, target, "semihosting"), target, Path(folder))
                begin = time.perf_counter()
                with openers()["semihosting"].open(target, image.elf, program.id) as link:
                    got = close_loop(program, loop, link)
                seconds = time.perf_counter() - begin
            same = got.same_as(expected)
            wrong += not same
            error = np.abs(got.reference - got.measurement)[499::500].mean()
            word = "same bits" if same else "DIFFERS"
            print(
                f"{name} {number}: {len(reference):,} steps, {word}; "
                f"mean error at the end of a stair {error:.3g} rad/s, {seconds:.0f} s",
                flush=True,
            )
    return wrong


if __name__ == "__main__":
    raise SystemExit(main())

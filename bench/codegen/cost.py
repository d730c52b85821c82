"""Count what a step of each controller kind costs on the Cortex-M4F in each number format, beside the bars to pass.

    python -m bench.codegen.cost       one line a law and format: instructions with the call, text, seconds to generate;
                                       names of laws take these alone

Instructions are counted by QEMU's -icount with the code at -O2; `most` is the costliest step that the stimuli find, the
first one and those with a NaN at an input included, `usual` the median. Behind them stands what -Os makes of the same
code, `*` where a usual step takes fewer instructions then. Exit status 1 when a bar is not kept.
"""

from __future__ import annotations

import json
import sys
import tempfile
import time
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from bench.codegen.example_laws import dense_law, example_law
from firmloop.codegen.emit import emit
from firmloop.codegen.firmware import firmware
from firmloop.codegen.target import load_target
from firmloop.design.kinds import kinds
from firmloop.design.law import Law
from firmloop.quantize.lower.lower import ARITHMETICS, lower
from firmloop.quantize.program import Program, QuantizeError
from firmloop.quantize.proof import proof
from firmloop.verify.block import run_blocks
from firmloop.verify.build.cost import instructions
from firmloop.verify.build.image import build_image
from firmloop.verify.compare import compare
from firmloop.verify.links.semihosting import open_semihosting
from firmloop.verify.proofs.checker import check_proof
from firmloop.verify.stimuli.stimuli import stimuli

STEPS = 20_000
TARGET = "qemu_mps2_an386"
# law, format -> most instructions of a usual step, most bytes of text
BARS: Mapping[tuple[str, str], tuple[int, int | None]] = {
    ("full pid", "float32"): (50, 250),
    ("full pid", "fixed32"): (55, 210),
    ("full pid", "fixed16"): (53, 180),
    ("transfer_function", "float32"): (60, None),
    ("transfer_function", "fixed32"): (110, None),
    ("dense 40", "float32"): (7000, 9000),
}
ONLY = {"dense 40": ("float32",)}  # formats of a law, where not all
SECONDS = 2.0  # to lower, prove, check again and print a law


def laws() -> Mapping[str, Law]:
    """Return the PID with every part in use, the example of every kind (transfer_function's is two biquads), more."""
    own = {name: kind.design(kind.example).law for name, kind in kinds().items()}
    return {"full pid": example_law(), **own, "dense 40": dense_law(40)}


def counts(program: Program, level: str) -> tuple[int, int, int]:
    """Return the median and the most of a step's instructions, and the bytes of the controller's code, at a level."""
    given, bundle = load_target(TARGET), emit(program, "firmloop generate project.toml")
    target = replace(given, flags=(*given.flags, level))
    blocks = stimuli(program, [], STEPS, 1)
    traces = run_blocks(program, blocks)
    with tempfile.TemporaryDirectory() as name:
        image = build_image(firmware(program, bundle, target, "semihosting"), target, Path(name))
        with open_semihosting(target, image.elf, program.id) as link:
            done = compare(program, link, blocks, traces, lambda part, label: None)
            found = instructions(done.ticks, link.hello().overhead_ticks, target)
    assert done.differences == 0, f"{program.name}: {done.differences} values differ"
    return int(np.median(found)), int(found.max()), image.controller.text_bytes


def main() -> int:
    """Print the table."""
    print("law               format    usual  most   bar   text   bar  generate s     -Os: usual   text")
    missed, chosen = 0, sys.argv[1:]
    for name, law in laws().items():
        for arithmetic in ONLY.get(name, ARITHMETICS) if not chosen or name in chosen else ():
            start = time.process_time()
            try:
                program = lower(law, arithmetic)
            except QuantizeError as error:
                print(f"{name:17} {arithmetic:9} refused: {error}")
                continue
            emit(program, "firmloop generate project.toml")
            check_proof(json.loads(json.dumps(proof(program, law.reasons))))
            seconds = time.process_time() - start
            (usual, most, text), (small, _, bytes_) = (counts(program, level) for level in ("-O2", "-Os"))
            bar, room = BARS.get((name, arithmetic), (None, None))
            marks = [f"{limit if limit is not None else '-':>5}" for limit in (bar, room)]
            print(
                f"{name:17} {arithmetic:9} {usual:5} {most:5} {marks[0]} {text:6} {marks[1]} {seconds:11.2f}"
                f"    {'*' if small < usual else ' '} {small:10} {bytes_:6}",
                flush=True,
            )
            missed += (bar is not None and usual > bar) + (room is not None and text > room) + (seconds > SECONDS)
    print(f"{missed} bars missed")
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())

"""Read the generated C of every kind in every format with tools that mostly run nothing, and give it no numbers.

    python -m bench.codegen.static             every example; names of examples take these alone

gcc's -fanalyzer under all warnings, cppcheck's MISRA C:2012 checks, the double-precision helpers that the linker took,
the stack from gcc's call graph, and what a NaN at each input does: outputs must keep their ranges, then and after it.
Exit status 1 when a tool finds something that no reason of codegen/misra.py covers.
"""

from __future__ import annotations

import shutil
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from bench.codegen.example_laws import example_law
from firmloop.codegen.bundle import Bundle
from firmloop.codegen.emit import emit
from firmloop.codegen.firmware import firmware
from firmloop.codegen.misra import deviations
from firmloop.codegen.target import load_target
from firmloop.design.kinds import kinds
from firmloop.design.law import Law
from firmloop.quantize.lower.lower import ARITHMETICS, lower
from firmloop.quantize.program import Program, QuantizeError
from firmloop.verify.build.host import build_host
from firmloop.verify.build.image import Image, build_image
from firmloop.verify.build.static_checks import read_statically
from firmloop.verify.compare import record_type
from firmloop.verify.links.library import LibraryLink
from firmloop.verify.packing import records
from firmloop.verify.stimuli.stimuli import characters

TARGET = "qemu_mps2_an386"
LOST_AT = 7  # sample in which an input is no number
SEEN = 40  # samples


def laws() -> Iterator[tuple[str, Law]]:
    """Give the PID with every part in use, and every example of every kind."""
    yield "full pid", example_law()
    for kind in kinds().values():
        for name, request in kind.examples.items():
            yield name, kind.design(request).law


def image(program: Program, bundle: Bundle) -> Image | None:
    """Build for the M4F; None without its compiler."""
    target = load_target(TARGET)
    if not shutil.which(target.compiler):
        return None
    with tempfile.TemporaryDirectory() as name:
        return build_image(firmware(program, bundle, target, target.links[0]), target, Path(name))


def spoiled(program: Program, bundle: Bundle) -> int:
    """Return how many outputs leave their range when an input is no number, once or for good, or after it."""
    if program.arithmetic.startswith("fixed"):
        return 0
    link = LibraryLink(build_host(bundle, load_target("host")), program)
    calm = next(block.inputs[0] for block in characters(program, 1, SEEN, 1) if block.name == "tracking")
    wrong = 0
    for places in (*((j,) for j in range(len(program.inputs))), tuple(range(len(program.inputs)))):
        for last in (LOST_AT + 1, SEEN):
            inputs = calm.copy()
            inputs[LOST_AT:last, places] = np.nan
            link.reset()
            answer = link.step(records(program, inputs, None), len(inputs))
            got = np.frombuffer(answer, dtype=record_type(program))
            for value in program.outputs:
                out = got[f"out_{value.name}"]
                wrong += int(np.sum(~((out >= value.low) & (out <= value.high))))
    return wrong


def main() -> int:
    """Print one line per kind and format, then each rule's reason."""
    chosen = sys.argv[1:]
    hits: Counter[str] = Counter()
    not_run: set[str] = set()
    wrong = 0
    print("law                    format    no reason  MISRA rules  double helpers  stack B  outputs lost to NaN")
    for name, law in laws():
        for arithmetic in ARITHMETICS if not chosen or name in chosen else ():
            try:
                program = lower(law, arithmetic)
            except QuantizeError as error:
                print(f"{name:22} {arithmetic:9} refused: {error}")
                continue
            bundle = emit(program, "firmloop generate project.toml")
            readings = read_statically(bundle)
            rules = [each for reading in readings for each in reading.findings if each.reason]
            bare = [each for reading in readings for each in reading.findings if not each.reason]
            not_run |= {f"{reading.tool}: {reading.not_run}" for reading in readings if reading.not_run}
            built, lost = image(program, bundle), spoiled(program, bundle)
            double = "-" if built is None else str(len(built.double_helpers))
            stack = "-" if built is None or built.stack_bytes is None else str(built.stack_bytes)
            figures = f"{len(bare):9} {len(rules):12} {double:>15} {stack:>8} {lost:20}"
            print(f"{name:22} {arithmetic:9} {figures}", flush=True)
            print("".join(f"    {each.file}:{each.line}: {each.says} [{each.rule}]\n" for each in bare), end="")
            hits += Counter(each.rule for each in rules)
            wrong += len(bare) + lost
            wrong += arithmetic != "float64" and built is not None and bool(built.double_helpers)
    for rule, deviation in deviations().items():
        count = hits[f"misra-c2012-{rule}"]
        print(f"rule {rule:5} {deviation.category:9} {count:5} hits in all: {deviation.why}")
    print("".join(f"not run: {each}\n" for each in sorted(not_run)), end="")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())

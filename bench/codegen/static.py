"""Read the generated C of every kind in every format with tools that mostly run nothing, and give it no numbers.

    python -m bench.codegen.static             every example; names of examples take these alone

gcc's -fanalyzer under all warnings, cppcheck's MISRA C:2012 checks, the double-precision helpers that the linker took,
the stack from gcc's call graph, and what a NaN at each input does: outputs must keep their ranges, then and after it.
Exit status 1 when a tool finds something that no reason below covers. cppcheck's MISRA addon is not a certified
checker; it gives rule numbers, the reasons are ours.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from bench.codegen.example_laws import example_law
from firmloop.codegen.bundle import Bundle, write_files
from firmloop.codegen.emit import emit
from firmloop.codegen.firmware import firmware
from firmloop.codegen.target import load_target
from firmloop.design.kinds import kinds
from firmloop.design.law import Law
from firmloop.quantize.lower.lower import ARITHMETICS, lower
from firmloop.quantize.program import Program, QuantizeError
from firmloop.verify.build.host import WARNINGS, build_host
from firmloop.verify.build.image import Image, build_image
from firmloop.verify.compare import record_type
from firmloop.verify.links.library import LibraryLink
from firmloop.verify.packing import records
from firmloop.verify.stimuli.stimuli import characters

TARGET = "qemu_mps2_an386"
LOST_AT = 7  # sample in which an input is no number
SEEN = 40  # samples

# Rule of MISRA C:2012 -> (category, why the generated code departs from it)
REASONS = {
    "2.3": ("advisory", "the array-size idiom stands for a static assertion, which C99 does not have"),
    "2.4": ("advisory", "status bits are an enumeration without a variable of its type"),
    "2.5": ("advisory", "macros of the header (program id, period, Q formats) are for the user"),
    "8.9": ("advisory", "a problem's numbers stand before the function that reads them, not inside it"),
    "9.3": ("required", "an array without a size is as long as its initializers, all of which are given"),
    "10.1": ("required", "arithmetic right shift of a signed value: asserted at compile time in fl_fixed.h"),
    "10.6": ("required", "a truth value (0 or 1) becomes a 32-bit word"),
    "10.7": ("required", "a shift's count is narrower than what is shifted, and is not converted to it"),
    "15.5": ("advisory", "a search ends where its answer is known, a step where an input is not a number"),
    "18.4": ("advisory", "a pointer goes through a matrix row by row, which an index would multiply for"),
    "19.2": ("advisory", "a float's bits are read or written as a word; C99 6.5.2.3 keeps the bytes of a union"),
    "20.1": ("advisory", "the sizes of a problem stand before the header that they size"),
}


def laws() -> Iterator[tuple[str, Law]]:
    """Give the PID with every part in use, and every example of every kind."""
    yield "full pid", example_law()
    for kind in kinds().values():
        for name, request in kind.examples.items():
            yield name, kind.design(request).law


def misra(folder: Path, sources: tuple[str, ...]) -> Counter[str]:
    """Return how often each rule is hit."""
    command = ["cppcheck", "--addon=misra", "--std=c99", "--quiet", *sources]
    said = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    return Counter(re.findall(r"\[misra-c2012-([0-9.]+)\]", said.stderr + said.stdout))


def analyzer(folder: Path, sources: tuple[str, ...]) -> list[str]:
    """Return what gcc's analyzer and all warnings say."""
    command = ["gcc", *WARNINGS, "-O2", "-fanalyzer", "-c", *sources]
    said = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    return said.stderr.strip().splitlines()


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
    wrong = 0
    print("law                    format    analyzer  MISRA  double helpers  stack B  outputs lost to NaN")
    for name, law in laws():
        for arithmetic in ARITHMETICS if not chosen or name in chosen else ():
            try:
                program = lower(law, arithmetic)
            except QuantizeError as error:
                print(f"{name:22} {arithmetic:9} refused: {error}")
                continue
            bundle = emit(program, "firmloop generate project.toml")
            with tempfile.TemporaryDirectory() as text:
                folder = Path(text)
                write_files(bundle.files, folder)
                words = analyzer(folder, bundle.sources)
                found = misra(folder, bundle.sources) if shutil.which("cppcheck") else Counter()
            built, lost = image(program, bundle), spoiled(program, bundle)
            double = "-" if built is None else str(len(built.double_helpers))
            stack = "-" if built is None or built.stack_bytes is None else str(built.stack_bytes)
            print(
                f"{name:22} {arithmetic:9} {len(words):8} {found.total():6} {double:>15} {stack:>8} {lost:20}",
                flush=True,
            )
            print("".join(f"    {word}\n" for word in words), end="")
            hits += found
            wrong += len(words) + sum(rule not in REASONS for rule in found) + lost
            wrong += arithmetic != "float64" and built is not None and bool(built.double_helpers)
    for rule, count in sorted(hits.items(), key=lambda item: [int(part) for part in item[0].split(".")]):
        category, why = REASONS.get(rule, ("?", "NO REASON GIVEN"))
        print(f"rule {rule:5} {category:9} {count:5} hits in all: {why}")
    if not shutil.which("cppcheck"):
        print("cppcheck is not installed: the MISRA checks were left out (apt-get install cppcheck)")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())

"""Read the generated C with tools that run nothing: gcc -fanalyzer, cppcheck with its MISRA C:2012 checks, the linker.

    python -m bench.static             the exit status is 1 when a tool finds something that no reason below covers

cppcheck's MISRA addon is not a certified checker; it gives rule numbers, the reasons are ours.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from pathlib import Path

from bench.mutants import example_law
from codegen.bundle import write_files
from codegen.emit import emit
from codegen.firmware import firmware
from codegen.target import load_target
from quantize.lower import ARITHMETICS, lower
from verify.build import build_image
from verify.host import WARNINGS

# Rule of MISRA C:2012 -> (category, why the generated code departs from it)
REASONS = {
    "2.3": ("advisory", "the array-size idiom stands for a static assertion, which C99 does not have"),
    "2.4": ("advisory", "status bits are an enumeration without a variable of its type"),
    "2.5": ("advisory", "macros of the header (program id, period, Q formats) are for the user"),
    "10.1": ("required", "arithmetic right shift of a signed value: asserted at compile time in fl_fixed.h"),
    "10.6": ("required", "a truth value (0 or 1) becomes a 32-bit word"),
}


def misra(folder: Path, source: str) -> Counter[str]:
    """Return how often each rule is hit."""
    command = ["cppcheck", "--addon=misra", "--std=c99", "--quiet", source]
    said = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    return Counter(re.findall(r"\[misra-c2012-([0-9.]+)\]", said.stderr + said.stdout))


def analyzer(folder: Path, source: str) -> list[str]:
    """Return what gcc's analyzer and all warnings say."""
    command = ["gcc", *WARNINGS, "-O2", "-fanalyzer", "-c", source, "-o", "analyzed.o"]
    said = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    return said.stderr.strip().splitlines()


def main() -> int:
    """Print one line per format, then each rule's reason."""
    law = example_law()
    hits: Counter[str] = Counter()
    wrong = 0
    target = load_target("qemu_mps2_an386")
    for arithmetic in ARITHMETICS:
        program = lower(law, arithmetic)
        bundle = emit(program, "firmloop generate motor_pid.toml")
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            write_files(bundle.files, folder)
            source = bundle.sources[0]
            words = analyzer(folder, source)
            found = misra(folder, source) if shutil.which("cppcheck") else Counter()
        hits += found
        double: tuple[str, ...] | None = None
        if shutil.which(target.compiler):
            with tempfile.TemporaryDirectory() as name:
                files = firmware(program, bundle, target, target.links[0])
                double = build_image(files, target, Path(name)).double_helpers
        helpers = "not built" if double is None else str(len(double))
        print(f"{arithmetic:9} analyzer {len(words)}, MISRA hits {found.total()}, double-precision helpers {helpers}")
        wrong += len(words) + sum(rule not in REASONS for rule in found)
        wrong += arithmetic != "float64" and bool(double)
    for rule, count in sorted(hits.items(), key=lambda item: [int(part) for part in item[0].split(".")]):
        category, why = REASONS.get(rule, ("?", "NO REASON GIVEN"))
        print(f"rule {rule:5} {category:9} {count:3} hits in all formats: {why}")
    if not shutil.which("cppcheck"):
        print("cppcheck is not installed: the MISRA checks were left out (apt-get install cppcheck)")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())

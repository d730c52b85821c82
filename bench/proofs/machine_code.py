"""Prove linked images equal to their programs, every straight-line kind on every core: `bench.proofs.machine_code`.

    python -m bench.proofs.machine_code                 every example in fixed point, on M0, M3, M4, M7 and M33
    python -m bench.proofs.machine_code notch pid       these alone; --core takes cores, --format a format
    python -m bench.proofs.machine_code --mutants 200   changes constants of the images by one unit, in turn, instead

Straight-line is what calls no support file: neither a solver nor a curve, which have loops or tables. Prints a line
for each image that is not proven, the share that is, and the time. Exit status 1 when a right image is refuted, the
share is below BAR, or a wrong constant is not refuted.
"""

from __future__ import annotations

import argparse
import random
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from bench.codegen.static import laws
from firmloop.design.law import Law
from firmloop.quantize.lower.lower import lower
from firmloop.quantize.ops import EVERY, LARGE
from firmloop.quantize.program import QuantizeError
from firmloop.verify.judgement import PROVEN, REFUTED
from firmloop.verify.proofs.claims import Claims
from firmloop.verify.proofs.judges import machine_code
from firmloop.verify.proofs.judges.machine_code import judge_image
from tests.verify.proofs.machine_code import linked, off_by_one

CORES = {
    "M0": "qemu_microbit",
    "M3": "qemu_mps2_an385",
    "M4": "qemu_mps2_an386",
    "M7": "qemu_mps2_an500",
    "M33": "qemu_mps2_an505",
}
FORMATS = ("fixed32", "fixed16")
BAR = 0.80


def straight(law: Law, arithmetic: str) -> bool:
    """Tell whether a law has a program in this format that calls no support file."""
    try:
        body = lower(law, arithmetic).body
    except QuantizeError:
        return False
    return not any(op.function in LARGE or EVERY[op.function].support for op in body)


def images(names: list[str], formats: list[str], cores: list[str], folder: Path) -> Iterator[tuple[str, Claims, Path]]:
    """Link every image, and yield what it is called, its claims and its file."""
    for name, law in laws():
        for arithmetic in formats if not names or name in names else ():
            if not straight(law, arithmetic):
                continue
            for core in cores:
                place = folder / f"{name} {arithmetic} {core}"
                place.mkdir()
                yield place.name, *linked(law, arithmetic, CORES[core], place)


def proofs(every: Iterator[tuple[str, Claims, Path]]) -> int:
    """Judge every image as it was linked."""
    results: Counter[str] = Counter()
    spent, longest = 0.0, 0.0
    for name, claims, elf in every:
        begin = time.process_time()
        result, says = judge_image(claims, elf)
        took = time.process_time() - begin
        spent, longest = spent + took, max(longest, took)
        results[result] += 1
        if result != PROVEN:
            print(f"{name}: {result}: {says}", flush=True)
        elif sys.stdout.isatty():
            print(f"{name}: {took:.1f} s", flush=True)
    share = results[PROVEN] / max(1, results.total())
    print(f"{results[PROVEN]} of {results.total()} images proven, {share:.1%}; {spent:.0f} s, longest {longest:.1f} s")
    return int(share < BAR or results[REFUTED] > 0)


def mutants(every: Iterator[tuple[str, Claims, Path]], count: int, folder: Path) -> int:
    """Judge images in which one constant is wrong by one unit."""
    found = [(name, claims, data) for name, claims, elf in every for data in off_by_one(claims, elf)]
    results: Counter[str] = Counter()
    begin = time.process_time()
    for name, claims, data in random.Random(1).sample(found, min(count, len(found))):
        elf = folder / "wrong.elf"
        elf.write_bytes(data)
        result, says = judge_image(claims, elf)
        results[result] += 1
        if result != REFUTED:
            print(f"{name}: a constant is wrong by one unit: {result} {says}", flush=True)
    spent = time.process_time() - begin
    print(f"{results[REFUTED]} of {results.total()} wrong constants refuted, of {len(found)} there are; {spent:.0f} s")
    return int(results[REFUTED] < results.total())


def main() -> int:
    """Link and judge."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("laws", nargs="*", metavar="LAW")
    parser.add_argument("--core", choices=list(CORES), action="append")
    parser.add_argument("--format", choices=FORMATS, action="append")
    parser.add_argument("--mutants", type=int, default=0, metavar="COUNT")
    parser.add_argument("--seconds", type=float, default=machine_code.LONGEST, help="for an image")
    asked = parser.parse_args()
    machine_code.LONGEST = asked.seconds
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        every = images(asked.laws, asked.format or list(FORMATS), asked.core or list(CORES), folder)
        return mutants(every, asked.mutants, folder) if asked.mutants else proofs(every)


if __name__ == "__main__":
    sys.exit(main())

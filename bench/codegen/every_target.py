"""Prove every controller of the tests on every emulated target: `python -m bench.codegen.every_target`.

Options: --steps N, --link NAME, and --target NAME and --law NAME as often as wanted. One line a run: differences,
instructions, stack, bytes. The exit status is the number of runs that differ.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator

from firmloop.codegen.emit import emit
from firmloop.codegen.target import Target, load_target, target_names
from firmloop.identify.simulation.compiler import ToolError
from firmloop.quantize.lower.lower import lower
from firmloop.quantize.program import QuantizeError
from firmloop.verify.run import verify
from tests.laws import TABLES, pid

NUMBERS = ("float32", "fixed32", "fixed16", "float64")


def emulated() -> Iterator[Target]:
    """Every target that QEMU stands in for."""
    for name in target_names():
        target = load_target(name)
        if target.qemu is not None:
            yield target


def numbers_of(target: Target) -> tuple[str, ...]:
    """Double precision only where the hardware computes it."""
    return tuple(number for number in NUMBERS if number != "float64" or "float64" in target.float_units)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--steps", type=int, default=20_000)
    parser.add_argument("--link", default=None)
    parser.add_argument("--target", action="append")
    parser.add_argument("--law", action="append", choices=sorted(TABLES))
    arguments = parser.parse_args()
    wrong = runs = steps = 0
    begin = time.perf_counter()
    for target in emulated():
        if arguments.target and target.name not in arguments.target:
            continue
        for name in arguments.law or TABLES:
            for number in numbers_of(target):
                law = pid(TABLES[name])
                try:
                    program = lower(law, number)
                except QuantizeError as error:
                    print(f"{target.name:24} {name:10} {number:8} has no such program: {error}")
                    continue
                bundle = emit(program, "firmloop generate bench.toml")
                try:
                    verdict = verify(
                        law, program, bundle, target, (), arguments.steps, 1, arguments.link, lambda share, doing: None
                    )
                except ToolError as error:
                    print(f"{target.name:24} {name:10} {number:8} not run: {error}")
                    continue
                cost = verdict.cost
                runs, steps, wrong = runs + 1, steps + verdict.steps, wrong + (not verdict.agrees)
                print(
                    f"{target.name:24} {name:10} {number:8} {verdict.steps:7,} steps "
                    f"{verdict.differences:3} differences, "
                    f"instructions {cost.instructions_min} to {cost.instructions_max}, mean {cost.instructions_mean}; "
                    f"stack {cost.stack_bytes}, text {cost.text_bytes}",
                    flush=True,
                )
    print(f"{runs} runs, {steps:,} steps, {wrong} that differ, {time.perf_counter() - begin:.0f} s")
    return wrong


if __name__ == "__main__":
    raise SystemExit(main())

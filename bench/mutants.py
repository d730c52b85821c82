"""Plant one fault at a time in generated C and count which ones the verifier calls `differs`.

    python -m bench.mutants            a table over all number formats, survivors listed

A fault is a changed constant (one unit in the last place, one percent, sign), shift, operator, comparison, operand
order, limit, store or status bit. A mutant that survives is run again on four times the steps from other seeds: what
still agrees is listed with its line, for a reader to judge whether it can change any output at all.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from codegen.bundle import Bundle
from codegen.emit import emit
from codegen.target import load_target
from design.kinds import design
from design.law import Law
from identify.compiler import ToolError
from identify.signal import Signal
from quantize.lower import ARITHMETICS, lower
from quantize.program import Program
from verify.compare import compare
from verify.host import build_host
from verify.links.library import LibraryLink
from verify.reference import Trace, run
from verify.stimuli import Block, stimuli


@dataclass(frozen=True, slots=True)
class Mutant:
    """One planted fault: which line of the C, what it was, what it is now."""

    what: str
    line: int
    before: str
    after: str


def example_law() -> Law:
    """Return a PID with every part in use: weights, filtered derivative, limits, back-calculation."""
    table = {"kp": 0.05, "ki": 1.4, "kd": 0.0004, "tf_s": 0.01, "tt_s": 0.05, "b": 0.7, "c": 0.2}
    inputs = (Signal("reference", "rad/s", -400.0, 400.0), Signal("measurement", "rad/s", -400.0, 400.0))
    return design("pid", "motor_pid", table, 0.001, inputs, (Signal("output", "V", -12.0, 12.0),), None).law


_NUMBER = r"(?<![\w.])\d+(?:\.\d+)?(?:e[+-]?\d+)?"


def _changed_numbers(line: str) -> Iterator[tuple[str, str]]:
    code, mark, note = line.partition("/*")
    for found in re.finditer(rf"{_NUMBER}(F|U)?", code):
        text, suffix = found[0].removesuffix("F").removesuffix("U"), found[1] or ""
        if suffix == "U":
            other = [str(int(text) + 1), str(max(1, int(text) - 1))]
        elif "." in text or "e" in text or suffix == "F":
            kind = np.float32 if suffix == "F" else np.float64
            x = kind(text)
            other = [str(np.nextafter(x, kind(np.inf))), str(x * kind(1.01)), str(-x) if x else "1.0"]
        else:
            n = int(text)
            other = [str(n + 1), str(n - 1) if n else "2", str(n + max(1, n // 100))]
        for new in other:
            if new != text:
                yield (
                    f"number {text} -> {new}",
                    code[: found.start()] + new + suffix + code[found.end() :] + mark + note,
                )


_SWAPS = (
    (" + ", " - "), (" - ", " + "), (" * ", " + "), (" < ", " <= "), (" < ", " > "), (" != ", " == "), ("0)", "1)"),
    ("fl_min", "fl_max"), ("fl_max", "fl_min"), (" | ", " & "), ("? 1 : 0", "? 0 : 1"), (" = -", " = "),
    ("in->reference", "in->measurement"), ("in->measurement", "in->reference"), ("(int16_t)", "(int8_t)"),
)  # fmt: skip


def mutants(bundle: Bundle) -> list[Mutant]:
    """Return every fault this module knows how to plant in the step function of a bundle, line by line."""
    lines = bundle.files[f"{bundle.name}.c"].splitlines()
    start = next(k for k, line in enumerate(lines) if f"{bundle.name}_step" in line)
    found: list[Mutant] = []
    for k in range(start, len(lines)):
        line = lines[k]
        if ";" not in line:
            continue
        code, mark, note = line.partition("/*")
        found += [Mutant(what, k, line, new) for what, new in _changed_numbers(line)]
        found += [
            Mutant(f"{a.strip()} -> {b.strip()}", k, line, code.replace(a, b, 1) + mark + note)
            for a, b in _SWAPS
            if a in code
        ]
        swapped = re.sub(r"= ([\w>-]+) - ([\w>-]+);", r"= \2 - \1;", code)
        if swapped != code:
            found.append(Mutant("operands swapped", k, line, swapped + mark + note))
        if "->" in code.partition("=")[0]:
            found.append(Mutant("store dropped", k, line, f"    (void){code.partition('=')[2].strip()}"))
        limited = re.sub(r"= fl_(?:clamp|min|max)_\w+\(([\w>-]+), .*\);", r"= \1;", code)
        if limited != code:
            found.append(Mutant("limit removed", k, line, limited + mark + note))
    unique = {(m.line, m.after): m for m in found if m.after != m.before}
    return list(unique.values())


def planted(bundle: Bundle, mutant: Mutant) -> Bundle:
    """Return the bundle with the fault in it."""
    name = f"{bundle.name}.c"
    lines = bundle.files[name].splitlines()
    lines[mutant.line] = mutant.after
    return replace(bundle, files={**bundle.files, name: "\n".join(lines) + "\n"})


@dataclass(frozen=True, slots=True)
class Bench:
    """One program with stimuli and reference, ready to judge mutants."""

    program: Program
    bundle: Bundle
    blocks: list[Block]
    traces: list[Trace]

    def outcome(self, bundle: Bundle) -> str:
        """Return "differs", "agrees", or "refused" where the compiler's warnings stop the mutant."""
        try:
            library = build_host(bundle, load_target("host"))
        except ToolError:
            return "refused"
        link = LibraryLink(library, self.program)
        done = compare(self.program, link, self.blocks, self.traces, lambda fraction, label: None)
        return "differs" if done.differences else "agrees"


def bench(law: Law, arithmetic: str, steps: int, seed: int) -> Bench:
    """Lower, emit and run the reference once."""
    program = lower(law, arithmetic)
    blocks = stimuli(program, [], steps, seed)
    return Bench(
        program, emit(program, "firmloop generate motor_pid.toml"), blocks, [run(program, b.inputs) for b in blocks]
    )


def main() -> int:
    """Print the table; the exit status is 0 when every format caught more than nothing and nothing went wrong."""
    law = example_law()
    print(f"{'format':10} {'mutants':>8} {'refused':>8} {'differs':>8} {'agrees':>8}")
    survivors: list[tuple[str, Mutant]] = []
    for arithmetic in ARITHMETICS:
        first = bench(law, arithmetic, 100_000, 1)
        more = [bench(law, arithmetic, 200_000, seed) for seed in (2, 3)]
        counts = {"refused": 0, "differs": 0, "agrees": 0}
        for mutant in mutants(first.bundle):
            text = planted(first.bundle, mutant)
            result = first.outcome(text)
            for other in more:
                if result == "agrees":
                    result = other.outcome(text)
            counts[result] += 1
            if result == "agrees":
                survivors.append((arithmetic, mutant))
        total = sum(counts.values())
        print(f"{arithmetic:10} {total:8} {counts['refused']:8} {counts['differs']:8} {counts['agrees']:8}", flush=True)
    for arithmetic, mutant in survivors:
        print(f"{arithmetic}: {mutant.what}\n    {mutant.before.strip()}\n    {mutant.after.strip()}")
    return 0


if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).parent.parent))
    sys.exit(main())

"""Plant one fault at a time in generated C and count which ones the verifier calls `differs`.

    python -m bench.mutants [KIND ...]  a sample over all formats of all kinds, or of those named; `--seed N` draws
                                        another sample, `--all` takes every mutant (hours)

A fault is a changed constant (one unit in the last place, one percent, sign), shift, operator, comparison, operand
order, limit, type, store or status bit. A mutant that survives is shown equivalent by z3, see `bench/equivalence.py`,
or run again on four times the steps from two other seeds; what then still agrees is listed and the exit status is 1.
"""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from bench.equivalence import equivalent
from firmloop.codegen.bundle import Bundle
from firmloop.codegen.emit import emit
from firmloop.codegen.target import load_target
from firmloop.design.kinds import design, kinds
from firmloop.design.law import Law
from firmloop.identify.signal import Signal
from firmloop.identify.simulation.compiler import ToolError
from firmloop.quantize.lower.lower import ARITHMETICS, lower
from firmloop.quantize.program import Program, QuantizeError
from firmloop.verify.block import Block, run_blocks
from firmloop.verify.build.host import build_host
from firmloop.verify.compare import compare
from firmloop.verify.links.library import LibraryLink
from firmloop.verify.proofs.any_state import AnyState, any_state, departures
from firmloop.verify.reference import Trace
from firmloop.verify.stimuli.stimuli import stimuli

STEPS = 60_000  # of the first campaign
SAMPLE = 16  # mutants of one kind and format


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


CHANGED: dict[str, dict[str, object]] = {  # in kinds' examples
    "mpc": {"budget": 40},
    "nmpc": {"warm_start": True, "iterations": 3},
}

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


_OTHER_TYPE = {"int64_t": "int32_t", "int32_t": "int16_t", "float": "int32_t", "double": "float"}
_SWAPS = (
    (" + ", " - "), (" - ", " + "), (" * ", " + "), (" < ", " <= "), (" < ", " > "), (" != ", " == "), ("0)", "1)"),
    ("fl_min", "fl_max"), ("fl_max", "fl_min"), (" | ", " & "), ("? 1 : 0", "? 0 : 1"), (" = -", " = "),
    ("in->reference", "in->measurement"), ("in->measurement", "in->reference"), ("(int16_t)", "(int8_t)"),
    ("&", "|"), (" >= ", " > "), (" <= ", " < "),
)  # fmt: skip


def mutants(bundle: Bundle) -> list[Mutant]:
    """Return every fault this module knows how to plant in the functions of a bundle, line by line."""
    lines = bundle.files[f"{bundle.name}.c"].splitlines()
    start = next(k for k, line in enumerate(lines) if line.startswith(f"void {bundle.name}_init"))
    found: list[Mutant] = []
    for k in range(start, len(lines)):
        line = lines[k]
        if ";" not in line and "if (" not in line:
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
        typed = re.sub(r"\bconst (int64_t|int32_t|double|float) ", lambda t: f"const {_OTHER_TYPE[t[1]]} ", code)
        if typed != code:
            found.append(Mutant("type", k, line, typed + mark + note))
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
    drawn: AnyState

    def outcome(self, bundle: Bundle) -> str:
        """Return "differs", "agrees", or "refused" where the compiler's warnings stop the mutant."""
        try:
            library = build_host(bundle, load_target("host"))
        except ToolError:
            return "refused"
        link = LibraryLink(library, self.program)
        done = compare(self.program, link, self.blocks, self.traces, lambda fraction, label: None)
        differences = done.differences or departures(self.program, link, self.drawn).differences
        return "differs" if differences else "agrees"


def bench(law: Law, arithmetic: str, steps: int, seed: int) -> Bench:
    """Lower, emit and run the reference once."""
    program = lower(law, arithmetic)
    blocks = stimuli(program, [], steps, seed)
    return Bench(
        program,
        emit(program, "firmloop generate motor_pid.toml"),
        blocks,
        run_blocks(program, blocks),
        any_state(program, seed, steps),
    )


def chosen(found: list[Mutant], count: int, seed: int | None = None) -> list[Mutant]:
    """Return `count` of them, evenly spread over the text, of every sort of fault; a seed draws others at random."""
    order = np.arange(len(found)) if seed is None else np.random.default_rng(seed).permutation(len(found))
    sorts: dict[str, list[Mutant]] = {}
    for k in order:
        sorts.setdefault(sort_of(found[k]), []).append(found[k])
    picked: list[Mutant] = []
    rank = 0
    while len(picked) < min(count, len(found)):
        for mutants_of_sort in sorts.values():
            if rank < len(mutants_of_sort) and len(picked) < count:
                # from the middle outward, so that neither the first nor the last lines weigh more
                picked.append(mutants_of_sort[(len(mutants_of_sort) // 2 + rank * 7) % len(mutants_of_sort)])
        rank += 1
    return list({(m.line, m.after): m for m in picked}.values())


def sort_of(mutant: Mutant) -> str:
    """Return the sort of a fault: a number, an operator, an order, a type, a limit, a store."""
    what = mutant.what
    if what.startswith("number"):
        new = what.rpartition(" ")[2]
        return "sign" if new.startswith("-") else "number"
    return what


def laws() -> dict[str, Law]:
    """Return the PID with every part in use, one with parameters that are tuned, and every kind's example.

    The predictive one gets a budget that some searches exceed: the one that its ranges ask for is never exceeded, so
    nothing could tell a flag that never rises from one that says so. Nor could it one that never falls, as with a
    nonlinear one that takes one step from no plan: that one takes three, from the plan of the sample before.
    """
    table = {"kp": 0.05, "ki": 1.4, "tt_s": 0.05, "tunable": ["kp", "ki"], "ranges": {"kp": [0, 0.2], "ki": [0, 5]}}
    full = example_law()
    tuned = design("pid", "tuned_pid", table, 0.001, full.inputs, full.outputs, None).law
    own = {
        name: kind.design(replace(kind.example, table=kind.example.table | CHANGED.get(name, {}))).law
        for name, kind in kinds().items()
    }
    return {"full pid": full, "tuned pid": tuned} | own


def main() -> int:
    """Print the table; the exit status is 1 when a mutant survives that is not shown to be equivalent."""
    asked = argparse.ArgumentParser()
    asked.add_argument("kinds", nargs="*")
    asked.add_argument("--all", action="store_true")
    asked.add_argument("--seed", type=int)
    args = asked.parse_args()
    print(f"{'kind':18} {'format':9} {'mutants':>8} {'refused':>8} {'differs':>8} {'equivalent':>10} {'survive':>8}")
    survivors: list[str] = []
    total = dict.fromkeys(("mutants", "refused", "differs", "equivalent", "survive"), 0)
    for name, law in laws().items():
        for arithmetic in ARITHMETICS if not args.kinds or name in args.kinds else ():
            try:
                first = bench(law, arithmetic, STEPS, 1)
            except QuantizeError as error:
                print(f"{name:18} {arithmetic:9} refused: {error}")
                continue
            more: list[Bench] = []
            found = mutants(first.bundle)
            counts = dict.fromkeys(total, 0)
            for mutant in found if args.all else chosen(found, SAMPLE, args.seed):
                text = planted(first.bundle, mutant)
                result = first.outcome(text)
                why = equivalent(first.program, mutant) if result == "agrees" else None
                if result == "agrees" and why is None:
                    more = more or [bench(law, arithmetic, 4 * STEPS, seed) for seed in (2, 3)]
                    result = next((r for r in (other.outcome(text) for other in more) if r != "agrees"), "agrees")
                word = {"agrees": "survive"}.get(result, result) if why is None else "equivalent"
                counts[word] += 1
                counts["mutants"] += 1
                if word in ("survive", "equivalent"):
                    shown = f"{name} {arithmetic}: {word}: {mutant.what}" + (f": {why}" if why else "")
                    survivors.append(f"{shown}\n    {mutant.before.strip()}\n    {mutant.after.strip()}")
            print(f"{name:18} {arithmetic:9} " + " ".join(f"{counts[k]:8}" for k in counts), flush=True)
            total = {key: total[key] + counts[key] for key in total}
    print(f"{'all':28} " + " ".join(f"{total[k]:8}" for k in total))
    print("\n".join(survivors))
    return 1 if total["survive"] else 0


if __name__ == "__main__":
    sys.exit(main())

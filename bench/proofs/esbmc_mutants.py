"""Count the faults planted in fixed-point C that ESBMC alone refutes: `python -m bench.proofs.esbmc_mutants [LAW ...]`.

Planted are wrong shifts, wrong bounds and dropped saturations, one at a time, by turns over the laws. The proof stays
that of the right C. A fault that keeps every claim for every input and state is none that a judge of these claims can
see: ESBMC then says "proven", and 200,000 random steps must not contradict it. Prints a row a sort of fault; the exit
status is 1 where the right C is not proven, a fault that steps show broken is "proven", or ESBMC gives no answer.
"""

from __future__ import annotations

import argparse
import json
import random
import re
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from bench.codegen.example_laws import laws
from bench.proofs.planting import Mutant, mutants, planted
from firmloop.codegen.bundle import Bundle, write_files
from firmloop.codegen.emit import emit
from firmloop.codegen.target import load_target
from firmloop.identify.simulation.compiler import ToolError
from firmloop.quantize.lower.lower import lower
from firmloop.quantize.program import Program
from firmloop.quantize.proof import proof
from firmloop.verify.build.host import build_host
from firmloop.verify.compare import record_type
from firmloop.verify.judgement import PROVEN, REFUTED
from firmloop.verify.links.library import LibraryLink
from firmloop.verify.proofs.judge import Delivered
from firmloop.verify.proofs.judges import every_judge
from firmloop.verify.proofs.reading import read_claims

LAWS = ("pid", "full pid", "lead_lag", "notch", "state_feedback")
STEPS = 200_000
_LIMIT = re.compile(r"fl_(clamp|min|max)_")
_SHIFT = re.compile(r"number \d+ -> \d+")


def sort_of(mutant: Mutant) -> str:
    """Return "wrong shift", "wrong bound" or "dropped saturation"; "" for any other fault."""
    if mutant.what == "limit removed":
        return "dropped saturation"
    if _SHIFT.fullmatch(mutant.what) and re.sub(r"\d+U", "", mutant.before) == re.sub(r"\d+U", "", mutant.after):
        return "wrong shift"
    return "wrong bound" if mutant.what.startswith("number") and _LIMIT.search(mutant.before) else ""


def breaks(program: Program, bundle: Bundle) -> bool:
    """Tell whether random steps from random states leave an output or a state outside its range."""
    link = LibraryLink(build_host(bundle, load_target("host")), program)
    dice, step = np.random.default_rng(1), np.dtype(record_type(program))
    size = 4 * len(program.state)
    states = dice.integers(0, 256, size=STEPS * size, dtype=np.uint8).tobytes()
    inputs = dice.integers(0, 256, size=STEPS * link.hello().in_bytes, dtype=np.uint8).tobytes()
    answers, left = link.step_from(states, size, inputs, STEPS)
    got, after = np.frombuffer(answers, step), np.frombuffer(left, "<i4").reshape(STEPS, -1)
    outputs = [got[f"out_{v.name}"] for v in program.outputs]
    columns: list[Any] = [*outputs, *after.T]
    values = (*program.outputs, *program.state)
    return any(np.any((x < v.low) | (x > v.high)) for x, v in zip(columns, values, strict=True))


def main() -> int:
    """Judge the right C of each law, then its faults."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("laws", nargs="*", default=list(LAWS), metavar="LAW")
    parser.add_argument("--count", type=int, default=100, help="of faults, in all")
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    judge, dice = every_judge()["esbmc"], random.Random(arguments.seed)
    if judge.version() is None:
        print(f"ESBMC is not here; {judge.install}")
        return 1
    counts: dict[str, Counter[str]] = {}
    wrong, longest = 0, 0.0
    for name in arguments.laws:
        law = laws()[name]
        program = lower(law, "fixed32")
        bundle = emit(program, "firmloop generate x.toml")
        claims = read_claims(json.loads(json.dumps(proof(program, law.reasons))))
        found = [mutant for mutant in mutants(bundle) if sort_of(mutant)]
        asked = dice.sample(found, min(len(found), arguments.count // len(arguments.laws)))
        for mutant in (None, *asked):
            made = bundle if mutant is None else planted(bundle, mutant)
            with tempfile.TemporaryDirectory() as folder:
                write_files(made.files, Path(folder))
                begin = time.monotonic()
                said = judge.judge(Delivered(claims, Path(folder)))
                longest = max(longest, time.monotonic() - begin)
            if mutant is None:
                print(f"{name}: the right C is {said.result}, {said.seconds:.0f} s; {len(found)} faults", flush=True)
                wrong += said.result != PROVEN
                continue
            result = said.result
            if result == PROVEN:
                try:
                    result = "FALSE PROOF" if breaks(program, made) else "keeps every claim"
                except ToolError:
                    result = "refused by the compiler"
            counts.setdefault(sort_of(mutant), Counter())[result] += 1
            if result not in (REFUTED, "keeps every claim", "refused by the compiler"):
                wrong += 1
                print(f"{name}, line {mutant.line + 1}: {result}: {mutant.what}: {mutant.after.strip()} {said.says}")
    for sort, results in counts.items():
        print(f"{sort:<20}" + ", ".join(f"{word} {count}" for word, count in sorted(results.items())))
    total = sum(counts.values(), Counter())
    reach = total.total() - total["keeps every claim"] - total["refused by the compiler"]
    print(
        f"{total.total()} faults; {total[REFUTED]} refuted of {reach} in reach of the claims; longest {longest:.0f} s"
    )
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())

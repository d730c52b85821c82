"""Count which of the faults planted in generated C the verifier calls `differs`.

    python -m bench.proofs.mutants [KIND ...]  a sample over all formats of all kinds, or of those named;
                                               `--seed N` draws another, `--all` takes every mutant (hours)

`bench/proofs/planting.py` tells what is planted. A mutant that survives is shown equivalent by z3, see
`bench/proofs/equivalence.py`, or run again on four times the steps from two other seeds; what then still agrees is
listed and the exit status is 1.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass

from bench.codegen.example_laws import laws
from bench.proofs.equivalence import equivalent
from bench.proofs.planting import chosen, mutants, planted
from firmloop.codegen.bundle import Bundle
from firmloop.codegen.emit import emit
from firmloop.codegen.target import load_target
from firmloop.design.law import Law
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

"""Measure how many steps `verify` does in a second of processor time, beside another checkout in the same run.

    python -m bench.host.verifying FOLDER [STEPS]

FOLDER is that checkout (`git worktree add FOLDER REVISION`). The PID with every part in use, in each format; the two
take turns, each run in a process of its own, and the shortest of three counts; what runs beside it, under the
sanitizers, counts too. Exit status 1 below the least ratio, or where the two verdicts are not the same.
"""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
from pathlib import Path

LEAST = 8.0  # times the steps of the other checkout
FORMATS = ("float32", "fixed32", "fixed16")
RUNS = 3


def measure(arithmetic: str, steps: int) -> None:
    """Print the seconds of a whole verification and a hash of its verdict."""
    from bench.codegen.example_laws import example_law
    from firmloop.codegen.emit import emit
    from firmloop.codegen.target import load_target
    from firmloop.quantize.lower.lower import lower
    from firmloop.verify.run import verify

    law = example_law()
    program = lower(law, arithmetic)
    bundle, host = emit(program, "firmloop generate project.toml"), load_target("host")
    verify(law, program, bundle, host, [], 1000, 1, None, lambda share, doing: None)  # what is built is kept
    begun = sum(os.times()[:4])
    verdict = verify(law, program, bundle, host, [], steps, 1, None, lambda share, doing: None)
    print(sum(os.times()[:4]) - begun, hashlib.sha256(repr(verdict).encode()).hexdigest())


def main() -> int:
    """Print one line a format."""
    if len(sys.argv) not in (2, 3):
        print(__doc__)
        return 2
    other, steps = Path(sys.argv[1]).resolve(), int(sys.argv[2]) if len(sys.argv) > 2 else 4_000_000
    missed = False
    for arithmetic in FORMATS:
        seconds: dict[Path, float] = {}
        said = set()
        for _ in range(RUNS):
            for tree in (other, Path.cwd()):
                call = f"import sys; sys.path[:0] = [{str(tree)!r}, {str(Path.cwd())!r}]\n"
                call += f"from bench.host.verifying import measure; measure({arithmetic!r}, {steps})"
                done = subprocess.run(
                    [sys.executable, "-c", call],
                    cwd=tree,
                    env={**os.environ, "PYTHONPATH": str(tree)},
                    capture_output=True,
                    text=True,
                    check=True,
                )
                taken, verdict = done.stdout.split()
                seconds[tree] = min(seconds.get(tree, float("inf")), float(taken))
                said.add(verdict)
        theirs, ours = (steps / seconds[tree] for tree in (other, Path.cwd()))
        same = "same verdict" if len(said) == 1 else "VERDICTS DIFFER"
        print(f"{arithmetic:8} {theirs:9,.0f} steps/s there, {ours:9,.0f} here: {ours / theirs:5.1f} times, {same}")
        missed |= ours < LEAST * theirs or len(said) > 1
    return int(missed)


if __name__ == "__main__":
    sys.exit(main())

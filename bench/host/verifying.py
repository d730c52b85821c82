"""Measure how many steps `verify` does in a second of processor time, beside another checkout in the same run.

    python -m bench.host.verifying FOLDER [STEPS] [LAW...]

FOLDER is that checkout (`git worktree add FOLDER REVISION`). The PID with every part in use, or laws by their names in
`bench/codegen/example_laws.py`, in each format (float32 alone where it solves a program); the two take turns, each run
in a process of its own, and the shortest of three counts; what runs beside it, under the sanitizers, counts too. Exit
status 1 below the least ratio, or where a step differs. Two verdicts are the same where nothing of them differs, the
costs and roundings that were met included; a change of the stimuli changes those.
"""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
from pathlib import Path

from bench.codegen.example_laws import laws

LEAST = 8.0  # times the steps of the other checkout
FORMATS = ("float32", "fixed32", "fixed16")
RUNS = 3


def measure(name: str, arithmetic: str, steps: int) -> None:
    """Print the seconds of a whole verification, the differences and a hash of its verdict."""
    from bench.codegen.example_laws import laws
    from firmloop.codegen.emit import emit
    from firmloop.codegen.target import load_target
    from firmloop.quantize.lower.lower import lower
    from firmloop.verify.run import verify

    law = laws()[name]
    program = lower(law, arithmetic)
    bundle, host = emit(program, "firmloop generate project.toml"), load_target("host")
    verify(law, program, bundle, host, [], 1000, 1, None, lambda share, doing: None)  # what is built is kept
    begun = sum(os.times()[:4])
    verdict = verify(law, program, bundle, host, [], steps, 1, None, lambda share, doing: None)
    seconds = sum(os.times()[:4]) - begun
    print(seconds, verdict.differences, hashlib.sha256(repr(verdict).encode()).hexdigest())


def main() -> int:
    """Print one line a format."""
    if len(sys.argv) < 2:
        print(__doc__)
        return 2
    other, steps = Path(sys.argv[1]).resolve(), int(sys.argv[2]) if len(sys.argv) > 2 else 4_000_000
    missed = [
        compared(other, name, kind, steps)
        for name in sys.argv[3:] or ["full pid"]
        for kind in (FORMATS[:1] if laws()[name].solve is not None else FORMATS)
    ]
    return int(any(missed))


def compared(other: Path, name: str, arithmetic: str, steps: int) -> bool:
    """Print the line of a law and a format; return whether it misses its bar."""
    seconds: dict[Path, float] = {}
    said, differences = set(), 0
    for _ in range(RUNS):
        for tree in (other, Path.cwd()):
            call = f"import runpy; runpy.run_path({__file__!r})['measure']({name!r}, {arithmetic!r}, {steps})"
            done = subprocess.run(
                [sys.executable, "-c", call],
                cwd=tree,
                env={**os.environ, "PYTHONPATH": str(tree)},
                capture_output=True,
                text=True,
                check=True,
            )
            taken, differing, verdict = done.stdout.split()
            seconds[tree] = min(seconds.get(tree, float("inf")), float(taken))
            said.add(verdict)
            differences += int(differing)
    theirs, ours = (steps / seconds[tree] for tree in (other, Path.cwd()))
    verdicts = "same verdict" if len(said) == 1 else "other stimuli"
    print(
        f"{name} {arithmetic:8} {theirs:9,.0f} steps/s there, {ours:9,.0f} here: {ours / theirs:5.1f} times, "
        f"{differences} differences, {verdicts}",
        flush=True,
    )
    return ours < LEAST * theirs or differences > 0


if __name__ == "__main__":
    sys.exit(main())

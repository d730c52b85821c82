"""Draw odd projects, recordings, frames, equations and bench work; count what is neither a result nor a sentence.

    python -m bench.host.fuzz [cases a door] [seed] [door ...]

62,500 cases in all by default, of every door. A case that fails is shown in its smallest form.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Callable

from hypothesis import HealthCheck, given, seed, settings

from bench import named
from tests.fuzz.targets import TARGETS, Target

CASES = 12_500
LONGEST = 20.0  # s of one case, of the processor's: a busy machine is no fault


def _attempts(target: Target, cases: int, start: int) -> Callable[[], None]:
    @seed(start)
    @settings(max_examples=cases, deadline=None, database=None, suppress_health_check=list(HealthCheck))
    @given(target.draw)
    def attempt(drawn: object) -> None:
        begin = sum(os.times()[:4])
        target.attempt(drawn)
        assert sum(os.times()[:4]) - begin < LONGEST, f"took more than {LONGEST:g} s"

    return attempt


def main() -> int:
    """Run the doors asked for; return 1 if any case failed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("cases", nargs="?", type=int, default=CASES, help="of each door")
    parser.add_argument("seed", nargs="?", type=int, default=1)
    parser.add_argument("doors", nargs="*", metavar="door", help=f"one of {', '.join(TARGETS)} (default: all)")
    asked = parser.parse_args()
    failed = 0
    for name in named(asked.doors, TARGETS, "door"):
        begin = time.monotonic()
        try:
            _attempts(TARGETS[name], asked.cases, asked.seed)()
            said = "no fault"
        except Exception as error:
            failed += 1
            said = "\n".join([f"{type(error).__name__}: {error}", *getattr(error, "__notes__", [])])
        print(f"{name:>12}: {asked.cases:,} cases in {time.monotonic() - begin:.0f} s: {said}", flush=True)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())

"""Draw odd projects, recordings, frames, equations and bench work; count what is neither a result nor a sentence.

    python -m bench.host.fuzz [cases a door] [seed] [door ...]

62,500 cases in all by default, of every door. A case that fails is shown in its smallest form.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable

from hypothesis import HealthCheck, given, seed, settings

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
    asked = [int(word) for word in sys.argv[1:3]]
    cases, start = (asked + [CASES, 1][len(asked) :])[:2]
    doors = sys.argv[3:] or list(TARGETS)
    failed = 0
    for name in doors:
        target = TARGETS[name]
        begin = time.monotonic()

        try:
            _attempts(target, cases, start)()
            said = "no fault"
        except Exception as error:
            failed += 1
            said = "\n".join([f"{type(error).__name__}: {error}", *getattr(error, "__notes__", [])])
        print(f"{name:>12}: {cases:,} cases in {time.monotonic() - begin:.0f} s: {said}", flush=True)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())

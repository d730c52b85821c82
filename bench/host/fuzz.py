"""Draw odd projects, recordings, frames and equations, and count what is neither a result nor a sentence.

    python -m bench.host.fuzz [cases a door] [seed]

50,000 cases in all by default. A case that fails is shown in its smallest form.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable

from hypothesis import HealthCheck, given, seed, settings

from tests.fuzz.targets import TARGETS, Target

CASES = 12_500
LONGEST = 20_000  # ms of one case


def _attempts(target: Target, cases: int, start: int) -> Callable[[], None]:
    @seed(start)
    @settings(max_examples=cases, deadline=LONGEST, database=None, suppress_health_check=list(HealthCheck))
    @given(target.draw)
    def attempt(drawn: object) -> None:
        target.attempt(drawn)

    return attempt


def main() -> int:
    """Run every door; return 1 if any case failed."""
    asked = [int(word) for word in sys.argv[1:]]
    cases, start = (asked + [CASES, 1][len(asked) :])[:2]
    failed = 0
    for name, target in TARGETS.items():
        begin = time.monotonic()

        try:
            _attempts(target, cases, start)()
            said = "no fault"
        except Exception as error:
            failed += 1
            said = f"{type(error).__name__}: {error}"
        print(f"{name:>12}: {cases:,} cases in {time.monotonic() - begin:.0f} s: {said}", flush=True)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())

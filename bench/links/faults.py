"""Damage the line 100,000 exchanges long and demand every value: `python -m bench.links.faults`.

The image's own C runs in this process; time is counted, so that a stall of 5 s costs nothing. Every step adds to a sum,
so that a step lost, run twice or run with other inputs shows in all values after it. The exit status is 0 if none did.
"""

from __future__ import annotations

import argparse
import random
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from firmloop.verify.link import LinkError
from firmloop.verify.links.frame import STEP, seal
from firmloop.verify.links.framed import FramedLink
from tests.verify.boards import PROGRAM, RESULT, expected, packed
from tests.verify.links.wild import WildLine, build_image_library

TIMEOUT, ATTEMPTS = 2.0, 8  # as on a port, with more attempts: a share of the passages is damaged, not one in a million
RESTART = 997  # exchanges after which the host is killed within a request, and another begins
RESET = 4999  # exchanges after which the image loses its memory


@dataclass(slots=True)
class Tally:
    """What happened."""

    exchanges: int = 0
    harmed: int = 0  # exchanges on whose way something was done to the bytes
    given_up: int = 0  # exchanges without an answer, said so to the caller
    wrong: int = 0  # values that were not those of the steps asked for
    clean_repeats: int = 0  # most repeats that an exchange needed on which nothing was done
    longest: float = 0.0  # s of counted time for one exchange
    restarts: int = 0
    resets_noticed: int = 0


def run(line: WildLine, library: object, exchanges: int, seed: int) -> Tally:
    """Exchange and check; a host that gives up opens the line anew."""
    tally, numbers = Tally(), np.random.default_rng(seed)
    sessions = random.Random(seed).randbytes
    link, total = open_link(line, sessions), 0.0
    while tally.exchanges < exchanges:
        tally.exchanges += 1
        if tally.exchanges % RESTART == 0:
            whole = seal(STEP, 7, b"\1" * 8)
            line.write(whole[: int(numbers.integers(1, len(whole)))])
            link, total, tally.restarts = open_link(line, sessions), 0.0, tally.restarts + 1
        if tally.exchanges % RESET == 0:
            library.image_reset()  # type: ignore[attr-defined]
        size = int(numbers.integers(1, 5))
        a, b = numbers.normal(size=(2, size)).astype(np.float32)
        sent, harmed, begin = line.sent, line.harmed, line.now
        try:
            results = np.frombuffer(link.step(packed(a, b), size), RESULT)
            answered = True
        except LinkError as error:
            answered = False
            tally.resets_noticed += "it was reset" in str(error)
            tally.given_up += "no reply" in str(error)
        tally.longest = max(tally.longest, line.now - begin)
        if not answered:
            link, total = open_link(line, sessions), 0.0
            continue
        outputs, total = expected(a, b, total)
        tally.wrong += int((results["sum"] != outputs).sum() + (results["status"] != (b > 1.0)).sum())
        if line.harmed == harmed:
            tally.clean_repeats = max(tally.clean_repeats, line.sent - sent - 1)
        else:
            tally.harmed += 1
    return tally


def open_link(line: WildLine, sessions: Callable[[int], bytes]) -> FramedLink:
    """Greet the image, as often as a person would run the command again."""
    for _ in range(20):
        try:
            link = FramedLink(line, "wild line", PROGRAM.id, TIMEOUT, ATTEMPTS, line.clock, sessions)
            link.reset()
            return link
        except LinkError:
            continue
    raise AssertionError("twenty commands in a row found no image behind the line")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--exchanges", type=int, default=100_000)
    parser.add_argument("--share", type=float, default=0.15, help="of the passages that are damaged")
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        library = build_image_library(Path(folder))
        begin = time.perf_counter()
        line = WildLine(library, arguments.share, arguments.seed)
        tally = run(line, library, arguments.exchanges, arguments.seed)
    print(tally)
    print(f"{time.perf_counter() - begin:.0f} s for {line.now:,.0f} s of counted time")
    return int(tally.wrong > 0 or tally.clean_repeats > 1 or tally.longest > TIMEOUT * (ATTEMPTS + 1))


if __name__ == "__main__":
    raise SystemExit(main())

"""Kill a hundred runs at random changes of files, and count what they leave: `python -m bench.host.kills [VERB...]`.

A verb, a new place or one with older results, and the change of a file before which the process ends are drawn; what is
left must be whole, old or new, and the next run there must give what an undisturbed one gives. Prints a row a verb; the
exit status is 1 where a file is half-written or a next run is not clean.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import random
import sys
import tempfile
from collections import Counter
from pathlib import Path

from bench import named
from bench.host.power_loss import VERBS, bench_of
from tests.fuzz.losses import Bench, lose_power_once


def main() -> int:
    """Kill them, verb by verb."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("verbs", nargs="*", metavar="VERB")
    parser.add_argument("--count", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    dice, failed, killed = random.Random(arguments.seed), 0, 0
    drawn = Counter(dice.choices(named(arguments.verbs, VERBS, "verb that is killed"), k=arguments.count))
    for verb, count in drawn.items():
        bad: list[str] = []
        with tempfile.TemporaryDirectory() as folder, open(os.devnull, "w") as nowhere:
            bench = bench_of(verb, Path(folder))
            with contextlib.redirect_stdout(nowhere), contextlib.redirect_stderr(nowhere):
                new, old = bench.run("x.toml", "new"), bench.run("old.toml", "old")
                changes = {again: _changes(bench, again) for again in (False, True)}
                for _ in range(count):
                    again = dice.random() < 0.5
                    at = dice.randint(1, changes[again])
                    try:
                        lose_power_once(bench, at, new, old if again else {})
                    except AssertionError as error:
                        bad.append(f"change {at}: {error}")
            swept = not list(Path(folder).rglob(".*"))
        failed, killed = failed + len(bad) + (not swept), killed + count
        print(f"{verb:>10}: {count} killed, {len(bad)} half-written or not clean after", *bad, flush=True)
        if not swept:
            print(f"{verb:>10}: the next run leaves something of the one before")
    print(f"{killed} killed at random changes; {failed} of them left something half-written or an unclean next run")
    return int(failed > 0)


def _changes(bench: Bench, again: bool) -> int:
    """Return how often the verb changes a file, in a new place or over older results."""
    name = f"counted{again}"
    if again:
        bench.run("old.toml", name)
    return bench.changes(name)


if __name__ == "__main__":
    sys.exit(main())

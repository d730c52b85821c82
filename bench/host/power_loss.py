"""Take power, room and memory away from each verb wherever that hurts: `python -m bench.host.power_loss [VERB...]`.

A verb whose results are half-written, whose next run is not clean, or that ends in anything but a sentence is told; the
exit status is their number.
"""

from __future__ import annotations

import contextlib
import os
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path

from bench import named
from tests.firmloop.conftest import PROJECT, recording
from tests.fuzz.losses import Bench, lose_memory, lose_power, lose_room

# Every so manieth change, where a run takes seconds and changes a hundred files.
VERBS = {"simulate": 1, "identify": 1, "design": 1, "generate": 1, "verify": 5, "diagnose": 2, "run": 9}


def bench_of(verb: str, folder: Path) -> Bench:
    """Lay out a project, and another one that differs in a gain and in a parameter."""
    for seed, name in enumerate(("train.csv", "test.csv"), 1):
        (folder / name).write_text(recording(seed))
    text = PROJECT.replace("gain = { value = 1.0", "gain = { value = 3.0").replace("value = 1.0", "value = 2.0")
    (folder / "x.toml").write_text(text)
    (folder / "old.toml").write_text(text.replace("kp = 0.8", "kp = 0.7").replace("value = 3.0", "value = 2.9"))

    def command(project: str, place: Path) -> list[str]:
        recordings = [str(folder / "test.csv")] if verb == "simulate" else []
        steps = ["--steps", "200"] if verb in ("verify", "run") else []
        return [verb, str(folder / project), *recordings, "--out", str(place), *steps]

    return Bench(folder, command, ".csv" if verb == "simulate" else "")


SWEEPS: Mapping[str, Callable[..., int]] = {
    "power, new place": partial(lose_power, again=False),
    "power, over older results": partial(lose_power, again=True),
    "room": lose_room,
    "memory": lose_memory,
}


def main() -> int:
    """Sweep each verb; print what was found."""
    failed = 0
    for verb in named(sys.argv[1:], VERBS, "verb that is swept"):
        begin, said = time.monotonic(), []
        for what, sweep in SWEEPS.items():
            with tempfile.TemporaryDirectory() as folder, open(os.devnull, "w") as nowhere:
                try:
                    with contextlib.redirect_stdout(nowhere), contextlib.redirect_stderr(nowhere):
                        times = sweep(bench_of(verb, Path(folder)), every=VERBS[verb])
                    said.append(f"{what} {times} times")
                except AssertionError as error:
                    failed += 1
                    said.append(f"{what}: FAILED: {error}")
        print(f"{verb:>10}: {'; '.join(said)}; {time.monotonic() - begin:.0f} s", flush=True)
    return failed


if __name__ == "__main__":
    sys.exit(main())

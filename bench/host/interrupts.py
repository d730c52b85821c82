"""Press Ctrl-C at random moments of each verb, and look at how it ends: `python -m bench.host.interrupts [VERB...]`.

Each run is a process of its own group, which gets SIGINT as a terminal sends it, its compilers and emulators too. It
has to end with status 130 and a sentence, or whole with status 0; without a traceback, a child that runs on, a file
half-written; and the next run there has to give what an undisturbed one gives. Half of the runs find no library that
an earlier one has compiled. The exit status is 1 where one does not.
"""

from __future__ import annotations

import argparse
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from pathlib import Path

from bench import named
from tests.firmloop.conftest import PROJECT, recording
from tests.fuzz.losses import held

ROOT = Path(__file__).parents[2]
TUNED = '\n[tuning]\nrules = ["simc", "amigo", "lambda"]\n'
TRIALS = PROJECT[: PROJECT.index("[controller]")]
SAYS = "firmloop: stopped; nothing was left half-written"
PATIENCE = 120.0  # s
# What each verb is run on, and what it is given besides.
VERBS: Mapping[str, tuple[str, tuple[str, ...]]] = {
    "identify": (PROJECT, ()),
    "simulate": (PROJECT, ()),
    "design": (PROJECT, ()),
    "tune": (PROJECT + TUNED, ()),
    "generate": (PROJECT, ()),
    "verify": (PROJECT, ("--steps", "2000")),
    "run": (PROJECT, ("--steps", "2000")),
    "diagnose": (PROJECT, ()),
    "model": (PROJECT + "\n[model]\n", ()),
    "step": (TRIALS, ()),
    "examine": (TRIALS, ()),
}


def step_response(seed: int) -> str:
    """Return a recording of one step, which the verb `step` asks for."""
    lines = recording(seed).splitlines()
    rows = [line.split(",") for line in lines[1:]]
    state, out = 0.0, [lines[0]]
    for k, (time_s, _, seen) in enumerate(rows):
        drive = 4.0 if k >= 20 else 0.0
        out.append(f"{time_s},{drive},{state + 0.0001 * (float(seen) % 1.0):.6g}")
        state += (1 - 0.9753) * (3.0 * drive - state)
    return "\n".join(out) + "\n"


class Desk:
    """A folder with a verb's project and recordings, its places for results, and its own cache of libraries."""

    def __init__(self, verb: str, folder: Path) -> None:
        self.verb, self.folder = verb, folder
        text, self.more = VERBS[verb]
        make: Callable[[int], str] = step_response if verb == "step" else recording
        for seed, name in enumerate(("train.csv", "test.csv"), 1):
            (folder / name).write_text(make(seed))
        (folder / "x.toml").write_text(text)

    def place(self, name: str) -> Path:
        return self.folder / (f"{name}.csv" if self.verb == "simulate" else name)

    def start(self, name: str, cache: str) -> subprocess.Popen[str]:
        given = [str(self.folder / "test.csv")] if self.verb == "simulate" else []
        words = [self.verb, str(self.folder / "x.toml"), *given, "--out", str(self.place(name)), *self.more]
        return subprocess.Popen(
            [sys.executable, "-m", "firmloop", *words],
            env={**os.environ, "PYTHONPATH": str(ROOT), "XDG_CACHE_HOME": str(self.folder / cache)},
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
            process_group=0,
        )

    def run(self, name: str, cache: str) -> tuple[dict[str, bytes], float]:
        """Run it undisturbed; return its results, and how long it took, s."""
        begun = time.monotonic()
        process = self.start(name, cache)
        _, said = process.communicate(timeout=PATIENCE)
        assert process.returncode in (0, 1), said
        return held(self.place(name)), time.monotonic() - begun

    def interrupt(self, name: str, cache: str, after: float, whole: Mapping[str, bytes]) -> str:
        """Press Ctrl-C `after` s; return what is wrong with how it ends, nothing where it is sound."""
        process = self.start(name, cache)
        try:
            _, said = process.communicate(timeout=after)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGINT)
            _, said = process.communicate(timeout=PATIENCE)
        left = held(self.place(name))
        ended = process.returncode in (0, 1) and left == whole
        # While Python starts it ends by the signal, without a word or with a traceback of its own modules. By the
        # signal it ends too where that came within an `exec`, as dataclasses use it: for a shell both are 130.
        told, before = said.rstrip().endswith(SAYS), "firmloop" not in said and not left
        if not (ended or (process.returncode in (130, -signal.SIGINT) and (told or before))):
            return f"status {process.returncode}: {said[-2000:]}"
        if (told or ended) and ("Traceback" in said or "Exception ignored" in said):
            return f"it says more than a sentence: {said[-2000:]}"
        if broken := [file for file, content in left.items() if content != whole.get(file)]:
            return f"half-written: {', '.join(broken)}"
        return _running_on(process.pid)


def _running_on(group: int) -> str:
    deadline = time.monotonic() + 2.0
    while time.monotonic() < deadline:
        try:
            os.killpg(group, 0)
        except ProcessLookupError:
            return ""
        time.sleep(0.05)
    return "a process that it started runs on"


def sweep(verb: str, folder: Path, count: int, dice: random.Random) -> list[str]:
    """Press Ctrl-C `count` times in runs of a verb; return what was wrong."""
    desk, wrong = Desk(verb, folder), []
    whole, cold = desk.run("cold", "cold_cache")
    again, warm = desk.run("warm", "cold_cache")
    assert again == whole, f"two undisturbed runs differ in {[k for k in whole if again.get(k) != whole[k]]}"
    for k in range(count):
        cache, length = (f"cache{k}", cold) if k % 2 else ("cold_cache", warm)
        after = dice.uniform(0.0, length)
        if says := desk.interrupt(f"out{k}", cache, after, whole):
            wrong.append(f"after {after:.2f} s of {length:.2f}: {says}")
        elif desk.run(f"out{k}", cache)[0] != whole:
            wrong.append(f"after {after:.2f} s of {length:.2f}: the next run is not clean")
    if rest := [path.name for path in folder.iterdir() if path.name.startswith(".")]:
        wrong.append(f"left behind: {', '.join(rest)}")
    return wrong


def main() -> int:
    """Sweep each verb; print what was found."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("verbs", nargs="*", metavar="VERB")
    parser.add_argument("--count", type=int, default=20, help="of each verb")
    parser.add_argument("--seed", type=int, default=1)
    asked = parser.parse_args()
    dice, failed = random.Random(asked.seed), 0
    for verb in named(asked.verbs, VERBS, "verb that is swept"):
        with tempfile.TemporaryDirectory() as folder:
            wrong = sweep(verb, Path(folder), asked.count, dice)
        failed += len(wrong)
        print(f"{verb:>10}: Ctrl-C {asked.count} times, {len(wrong)} not sound", *wrong, sep="\n  ", flush=True)
    return int(failed > 0)


if __name__ == "__main__":
    sys.exit(main())

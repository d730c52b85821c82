"""Diagnose one written case through the command line, and set what was said beside what is hidden."""

from __future__ import annotations

import json
import math
import os
import resource
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from bench.diagnose.hidden import Hidden, Truth, read_truth, truth_of
from firmloop.identify.error import IdentifyError
from firmloop.identify.recordings.recording import read_recording
from firmloop.project.project import read_project
from firmloop.project.table import ProjectError
from firmloop.stages.prediction import Start, at_rest, predicted

SHOWN = 1.0  # times the noise that the best refit leaves without an effect, from which it counts as visible
LONGEST = 900  # s of CPU time, after which a case is cut
WORSE = 1.01  # times the plain refit's rms, from which the written project does harm


@dataclass(frozen=True, slots=True)
class Scored:
    """One case: what is hidden, what `firmloop diagnose` said, and the CPU time it took.

    `verdict` is that of diagnosis.json; "refused" is a sentence instead of one, "cut" a case that took too long,
    "crash" anything else. `covered` tells of every 95 % interval of a hidden effect that is named whether it holds.
    """

    case: str
    truth: Truth
    verdict: str
    names: tuple[str, ...]
    covered: tuple[bool, ...]
    worse: float  # largest rms of the written project, simulated from rest, over the plain refit's; 0 where unknown
    seconds: float
    says: str  # the last line printed

    @property
    def hidden(self) -> tuple[str, ...]:
        """Names of what is hidden."""
        return tuple(sorted(each.name for each in self.truth.hidden))

    @property
    def visible(self) -> bool:
        """Whether everything hidden shows."""
        return self.truth.visible >= SHOWN

    @property
    def silent(self) -> bool:
        """Whether nothing is said to be missing."""
        return self.verdict == "no_mismatch"

    @property
    def exact(self) -> bool:
        """Whether just the hidden effects explain the recordings."""
        return self.verdict == "explained" and tuple(sorted(self.names)) == self.hidden

    @property
    def one_function(self) -> bool:
        """Whether the recordings cannot tell what is said from what is hidden.

        A set of what is one function with it, what is hidden among them; or an explanation that is the same sum.
        """
        same = {name for each in self.truth.hidden for group in each.same for name in group}
        hidden, named = set(self.hidden), set(self.names)
        if self.verdict == "explained" and len(hidden) == 1:
            return any(len(group) > 1 and named == set(group) for group in self.truth.hidden[0].same)
        return self.verdict == "ambiguous" and hidden < named <= hidden | same

    @property
    def wrong(self) -> bool:
        """Whether an explanation stands that names what is not there."""
        return self.verdict == "explained" and not self.one_function and not set(self.names) <= set(self.hidden)


def scored(folder: Path) -> Scored:
    """Diagnose one case in a process of its own."""
    truth = read_truth(folder)
    with tempfile.TemporaryDirectory() as place:
        out = Path(place) / "out"
        status, text, seconds = command("diagnose", folder / "project.toml", "--out", out)
        path = out / "diagnosis.json"
        says = text.strip().splitlines()[-1] if text.strip() else ""
        if status not in (0, 1) or not path.is_file():
            return Scored(folder.name, truth, failure(status, text), (), (), 0.0, seconds, says)
        said = json.loads(path.read_text(encoding="utf-8"))
        worse = harm(folder, out, said)
    names = tuple(each["name"] for each in said["effects"])
    covered = tuple(hit for each in truth.hidden for entry in said["effects"] for hit in holds(each, entry))
    return Scored(folder.name, truth, said["verdict"], names, covered, worse, seconds, says)


def command(*words: str | Path) -> tuple[int, str, float]:
    """Run `firmloop` on one thread; return its exit status, what it printed, and the CPU time of it and its children.

    The start of the interpreter, about a second, is part of that time.
    """
    with tempfile.TemporaryFile("w+") as said:
        one = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
        process = subprocess.Popen(
            [sys.executable, "-m", "firmloop", *map(str, words)],
            stdout=said, stderr=subprocess.STDOUT, env={**os.environ, **one},
        )  # fmt: skip
        resource.prlimit(process.pid, resource.RLIMIT_CPU, (LONGEST, LONGEST))
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        said.seek(0)
        return process.returncode, said.read(), usage.ru_utime + usage.ru_stime


def failure(status: int, text: str) -> str:
    """Return what an end without a verdict is."""
    if status in (-24, -9):  # SIGXCPU, and SIGKILL at the hard limit
        return "cut"
    return "refused" if status == 2 and "Traceback" not in text else "crash"


def harm(folder: Path, out: Path, said: Mapping[str, Any]) -> float:
    """Return the largest rms of the written project, simulated here, over what the report says of the plain refit."""
    shares = [0.0]
    recordings = read_project(folder / "project.toml").recordings
    assert recordings is not None
    for part, files in (("train", recordings.train), ("test", recordings.test)):
        told = said["simulation_rms"].get(part, {})
        paths = [folder / Path(each).name for each in files]
        for output, rms in (simulated_rms(out / "project.toml", paths, at_rest) if paths else {}).items():
            refit = told.get(output, {}).get("refit")
            shares += [rms / refit] if refit else []
    return max(shares)


def simulated_rms(project: Path, recordings: Sequence[Path], start: Start) -> Mapping[str, float]:
    """Return the rms of measured - simulated of every output over all recordings, from the input alone.

    It is infinite where the project does not simulate.
    """
    made = read_project(project)
    assert made.plant is not None and made.recordings is not None
    lefts: dict[str, list[Any]] = {name: [] for name in made.plant.outputs}
    for path in recordings:
        real = read_recording(path, {}, made.recordings.hold)
        try:
            ours = predicted(made, real, start)
        except (IdentifyError, ProjectError):
            return dict.fromkeys(lefts, math.inf)
        for name, left in lefts.items():
            left.append(real.columns[name] - ours.columns[name])
    return {name: float(np.sqrt(np.mean(np.concatenate(left) ** 2))) for name, left in lefts.items()}


def holds(hidden: Hidden, entry: Mapping[str, Any]) -> list[bool]:
    """Tell of every interval of a named effect whether it holds what is hidden; a phase comes round again."""
    if entry["name"] != hidden.name or entry.get("output") not in (None, hidden.output):
        return []
    found = []
    for name, value in hidden.parameters.items():
        told = entry["parameters"].get(name)
        if told and told["ci95"]:
            low, high = told["ci95"]
            turns = (-2.0 * math.pi, 0.0, 2.0 * math.pi) if name == "phase_rad" else (0.0,)
            found.append(any(low <= value + turn <= high for turn in turns))
    return found


def as_line(case: Scored) -> str:
    """Return a case as one line of JSON."""
    return json.dumps(asdict(case))


def of_line(line: str) -> Scored:
    """Make a case of its line."""
    document = json.loads(line)
    lists = {name: tuple(document[name]) for name in ("names", "covered")}
    return Scored(**{**document, **lists, "truth": truth_of(document["truth"])})

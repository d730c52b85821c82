"""Diagnose written cases through the command line and count what came out against what is hidden."""

from __future__ import annotations

import json
import resource
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import scipy

from bench.diagnose.hidden import Truth, read_truth

SHOWN = 1.0  # times the noise that the best refit leaves without an effect, from which it counts as visible
CONFIDENCE = 0.95


@dataclass(frozen=True, slots=True)
class Scored:
    """One case: what is hidden, what `firmloop diagnose` said, and the CPU time it took."""

    case: str
    truth: Truth
    verdict: str  # "crash" or "refused" where there is none
    names: tuple[str, ...]
    covered: tuple[bool, ...]  # of every 95 % interval of an effect that is there
    harm: bool  # some output of train or test is simulated worse than by the plain refit
    seconds: float

    @property
    def hidden(self) -> tuple[str, ...]:
        """Names of what is hidden."""
        return tuple(sorted(each.name for each in self.truth.hidden))

    @property
    def visible(self) -> bool:
        """Whether every hidden effect shows."""
        return all(each.visible >= SHOWN for each in self.truth.hidden)

    @property
    def exact(self) -> bool:
        """Whether just the hidden effects are named."""
        return tuple(sorted(self.names)) == self.hidden

    @property
    def alike(self) -> bool:
        """Whether what is hidden is named, and all else that is named is one function with something hidden."""
        same = {name for each in self.truth.hidden for group in each.same for name in group}
        return set(self.hidden) <= set(self.names) <= set(self.hidden) | same


def scored(folder: Path) -> Scored:
    """Diagnose one case in a process of its own."""
    truth = read_truth(folder)
    with tempfile.TemporaryDirectory() as out:
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        words = [sys.executable, "-m", "firmloop", "diagnose", str(folder / "project.toml"), "--out", out]
        done = subprocess.run(words, capture_output=True, text=True)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        path = Path(out) / "diagnosis.json"
        if not path.exists():
            verdict = "refused" if done.returncode == 2 else "crash"
            return Scored(folder.name, truth, verdict, (), (), False, seconds)
        said = json.loads(path.read_text(encoding="utf-8"))
    names = tuple(each["name"] for each in said["effects"])
    covered = tuple(hit for each in truth.hidden for entry in said["effects"] for hit in _covered(each, entry))
    harm = any(
        figures["after"] > 1.01 * figures["refit"]
        for outputs in said["simulation_rms"].values()
        for figures in outputs.values()
        if {"after", "refit"} <= set(figures)
    )
    return Scored(folder.name, truth, said["verdict"], names, covered, harm, seconds)


def _covered(hidden: Any, entry: Mapping[str, Any]) -> list[bool]:
    if entry["name"] != hidden.name or entry.get("output") not in (None, hidden.output):
        return []
    pairs = [(entry["parameters"].get(name), value) for name, value in hidden.parameters.items()]
    return [each["ci95"][0] <= value <= each["ci95"][1] for each, value in pairs if each and each["ci95"]]


def table(cases: Sequence[Scored]) -> list[str]:
    """Return the lines of the report."""
    singles = [each for each in cases if len(each.hidden) == 1]
    seen = [each for each in singles if each.visible]
    nulls = [each for each in cases if not each.hidden and not each.truth.outside]
    several = {"pairs": 2, "triples": 3}
    lines = [
        _share("single, visible: exactly named", [each.exact for each in seen]),
        _share("single, visible: exactly named or with what is one function", [each.alike for each in seen]),
        _share("single, all: named wrongly", [bool(each.names) and not each.alike for each in singles]),
    ]
    for word, size in several.items():
        lines.append(
            _share(f"{word}, each visible: exact", [e.exact for e in cases if len(e.hidden) == size and e.visible])
        )
    outside = [each for each in cases if each.truth.outside and each.truth.outside_visible >= SHOWN]
    lines.append(
        _share("not in the library, visible: unknown_physics", [e.verdict == "unknown_physics" for e in outside])
    )
    alarms = sum(each.verdict not in ("no_mismatch", "refused") for each in nulls)
    lines.append(f"nothing concealed: {alarms} false alarms of {len(nulls)}{_at_most(alarms, len(nulls))}")
    lines.append(_share("95 % interval covers", [hit for each in cases for hit in each.covered]))
    lines.append(_share("written project worse than the plain refit", [each.harm for each in cases]))
    lines.append(_share("crashed", [each.verdict == "crash" for each in cases]))
    lines.append(_share("refused", [each.verdict == "refused" for each in cases]))
    times = sorted(each.seconds for each in cases) or [0.0]
    p90 = times[min(int(0.9 * len(times)), len(times) - 1)]
    lines.append(f"CPU time per case: median {times[len(times) // 2]:.1f} s, p90 {p90:.1f} s, most {times[-1]:.1f} s")
    wrong = [each for each in cases if not (each.alike if each.hidden else each.verdict in ("no_mismatch", "refused"))]
    return lines + [f"  {e.case}: {e.hidden or e.truth.outside or 'nothing'} -> {e.verdict} {e.names}" for e in wrong]


def _share(words: str, hits: Sequence[bool]) -> str:
    return f"{words}: {sum(hits)} of {len(hits)}" + (f" ({100.0 * sum(hits) / len(hits):.1f} %)" if hits else "")


def _at_most(count: int, of: int) -> str:
    """Return the upper end of the rate that the count allows (Clopper and Pearson, Biometrika 26 (1934) 404-413)."""
    if not of:
        return ""
    return f", a rate of at most {100.0 * float(scipy.stats.beta.ppf(CONFIDENCE, count + 1, of - count)):.1f} %"

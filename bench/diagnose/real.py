"""Diagnose real machines from their linear nominal and print the figures: `python -m bench.diagnose.real`.

    FIRMLOOP_RECORDINGS=... python -m bench.diagnose.real [--only emps] [--keep FOLDER] [--lines FILE.jsonl]

Every machine is a project as the contract describes it, and everything goes through the command line: `identify` makes
the plain refit, `diagnose` the improved project. Nothing tells the tool what is missing. Below a machine's row stands
each output of each recording, simulated from its input alone, the initial state fitted, for some begin in motion: rms
of the plant as given, of the plain refit, of the improved project. An improved project that is worse than the plain
refit anywhere does harm.
"""

from __future__ import annotations

import argparse
import json
import math
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from bench.diagnose.real_machines import MACHINES, ROOT, Machine
from bench.diagnose.scored import WORSE, command, failure, simulated_rms
from firmloop.stages.prediction import as_recorded


def project_of(machine: Machine, folder: Path) -> Path:
    """Put the recordings and the project of a machine into a folder; return the project."""
    folder.mkdir(parents=True, exist_ok=True)
    machine.prepare(ROOT / machine.name, folder)
    project = folder / "project.toml"
    if machine.plant:
        lists = [json.dumps(list(names)) for names in (machine.train, machine.test)]
        text = f'schema = 1\nname = "{machine.name}"\n[recordings]\ntrain = {lists[0]}\ntest = {lists[1]}\n'
        project.write_text(f"{text}[plant]{machine.plant}", encoding="utf-8")
    else:
        project.write_text((ROOT / machine.name / machine.file).read_text(encoding="utf-8"), encoding="utf-8")
    return project


def measure(machine: Machine, folder: Path) -> Mapping[str, Any]:
    """Refit and diagnose one machine; return its figures."""
    project = project_of(machine, folder)
    refused, words, _ = command("identify", project, "--out", folder / "refit")
    status, said, seconds = command("diagnose", project, "--out", folder / "out")
    (folder / "said.txt").write_text(said, encoding="utf-8")
    found: dict[str, Any] = {"machine": machine.label, "seconds": seconds, "names": [], "unit": machine.unit}
    found["refit_says"] = words.strip().splitlines()[-1] if refused else ""
    if status not in (0, 1):
        lines = said.strip().splitlines() or [""]
        return {**found, "verdict": failure(status, said), "says": lines[-1], "rows": [], "met": False}
    document = json.loads((folder / "out" / "diagnosis.json").read_text(encoding="utf-8"))
    projects = {"given": project, "refit": folder / "refit" / "project.toml", "after": folder / "out" / "project.toml"}
    projects = {key: path for key, path in projects.items() if path.is_file()}
    rows = []
    for part, names in (("train", machine.train), ("test", machine.test)):
        for name in names:
            by = {
                key: simulated_rms(path, [folder / name], as_recorded)
                for key, path in projects.items()
                if path.is_file()
            }
            for output, after in by["after"].items():
                refit = by["refit"][output] if "refit" in by else None
                rows.append([part, name, output, by["given"][output], refit, after])
    named = [effect["name"] for effect in document["effects"]]
    files = [folder / name for name in machine.judged or machine.test]
    judged = {key: machine.score(path, files, folder) for key, path in projects.items()}
    met = judged["after"] <= machine.bar and not set(named) & set(machine.unwanted)
    met &= not machine.wanted or bool(set(named) & set(machine.wanted))
    found |= {"verdict": document["verdict"], "names": named, "rows": rows, "judged": judged, "bar": machine.bar}
    return {**found, "says": "", "met": met}


def harms(figures: Mapping[str, Any]) -> int:
    """Count the outputs of recordings where the improved project is worse than the plain refit."""
    pairs = [(row[4], row[5]) for row in figures["rows"]]
    return sum(not after <= WORSE * refit for refit, after in pairs if refit is not None)


def told(figures: Mapping[str, Any]) -> list[str]:
    """Return the lines of a machine."""
    named = ", ".join(figures["names"]) or figures["says"]
    judged = figures.get("judged", {})
    three = "".join(f"{judged.get(key, math.nan):9.4g} " for key in ("given", "refit", "after"))
    bar, harm, seconds = figures.get("bar", math.nan), harms(figures), figures["seconds"]
    lines = [
        f"{figures['machine']:31}{figures['verdict']:16}{three}{bar:8.3g} {figures['unit']:6}{seconds:7.1f} s  "
        f"{'yes' if figures['met'] else 'NO':4}{f'harm in {harm}' if harm else 'no harm':11}{named}"
    ]
    if figures["refit_says"]:
        lines.append(f"  no plain refit: {figures['refit_says']}")
    for part, name, output, given, refit, after in figures["rows"]:
        worse = refit is not None and not after <= WORSE * refit
        plain = f"{refit:9.4g}" if refit is not None else f"{'-':>9}"
        lines.append(f"  {part:6}{name:39}{given:9.4g} {plain} {after:9.4g}  {output}{'  WORSE' if worse else ''}")
    return lines


def read(file: Path | None) -> list[Mapping[str, Any]]:
    """Return the figures that a file of lines holds."""
    if file is None or not file.is_file():
        return []
    return [json.loads(line) for line in file.read_text(encoding="utf-8").splitlines()]


def table(every: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return the last lines: how many machines meet their bar, and how many are done no harm."""
    met = sum(bool(figures["met"]) for figures in every)
    unharmed = sum(bool(figures["rows"]) and not harms(figures) for figures in every)
    return [f"met: {met} of {len(every)}; a project no worse than the plain refit anywhere: {unharmed} of {len(every)}"]


def main() -> int:
    """Run the machines asked for; the exit status is 1 where one misses its bar or is done harm."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="*", default=[machine.name for machine in MACHINES])
    parser.add_argument("--keep", type=Path)
    parser.add_argument("--lines", type=Path, help="file of JSON lines to go on with")
    chosen = parser.parse_args()
    known = {figures["machine"]: figures for figures in read(chosen.lines)}
    every = []
    print(f"{'machine':31}{'verdict':16}{'given':>9} {'refit':>9} {'after':>9} {'bar':>8} {'':6}{'diagnose':>9}  met")
    with tempfile.TemporaryDirectory() as made:
        for machine in MACHINES:
            if not {machine.name, machine.label} & set(chosen.only) or not (ROOT / machine.name).is_dir():
                continue
            folder = (chosen.keep or Path(made)) / machine.label
            figures = known.get(machine.label) or measure(machine, folder)
            if chosen.lines and machine.label not in known:
                with chosen.lines.open("a", encoding="utf-8") as stream:
                    stream.write(json.dumps(figures) + "\n")
            print("\n".join(told(figures)), flush=True)
            every.append(figures)
    print("\n".join(table(every)))
    return int(not all(figures["met"] and not harms(figures) for figures in every))


if __name__ == "__main__":
    raise SystemExit(main())

"""Diagnose cases again in other circumstances and compare every byte: `python -m bench.diagnose.same --count 3`.

Idle; beside two busy loops; stopped and continued by turns, which halves its speed; without test recordings and with
them in another order; with the lines of the project and the columns of the recordings in another order. What is
written has to be the same, but for what it says of test recordings where those differ.
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from bench.diagnose import simulated

_TURN = 0.05  # s of running, and of standing still
ABOUT_TESTS = ("fit", "simulation_rms")  # keys of diagnosis.json that hold a part for test recordings


def diagnosed(project: Path, out: Path, driven: Callable[[int], None]) -> Mapping[str, Any]:
    """Return what the command writes, by file, or how it ended; `driven` gets its process id."""
    words = [sys.executable, "-m", "firmloop", "diagnose", str(project), "--out", str(out)]
    with subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True) as run:
        driven(run.pid)
        status = run.wait()
    if status not in (0, 1):
        return {"status": status}
    return {name: (out / name).read_text(encoding="utf-8") for name in ("diagnosis.json", "project.toml")}


def at_full_speed(process: int) -> None:
    """Leave a process alone."""


def at_half_speed(process: int) -> None:
    """Stop and continue the session of a process by turns as long as it lives."""

    def turns() -> None:
        try:
            while True:
                time.sleep(_TURN)
                os.killpg(process, signal.SIGSTOP)
                time.sleep(_TURN)
                os.killpg(process, signal.SIGCONT)
        except ProcessLookupError:
            return

    threading.Thread(target=turns, daemon=True).start()


@contextmanager
def busy(count: int) -> Iterator[None]:
    """Keep that many processors busy."""
    loops = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(count)]
    try:
        yield
    finally:
        for loop in loops:
            loop.kill()
            loop.wait()


def copied(case: Path, folder: Path) -> Path:
    """Copy the recordings and the project of a case; return the project."""
    folder.mkdir(parents=True)
    for path in (*case.glob("*.csv"), case / "project.toml"):
        (folder / path.name).write_bytes(path.read_bytes())
    return folder / "project.toml"


def without_tests(project: Path) -> None:
    """Leave the test recordings out of a project."""
    lines = project.read_text(encoding="utf-8").splitlines(keepends=True)
    project.write_text("".join(line for line in lines if not line.startswith("test = ")), encoding="utf-8")


def with_tests_turned(project: Path) -> None:
    """Name the test recordings in the other order."""
    lines = project.read_text(encoding="utf-8").splitlines()
    turned = [f"test = {json.dumps(_files(line)[::-1])}" if line.startswith("test = ") else line for line in lines]
    project.write_text("\n".join([*turned, ""]), encoding="utf-8")


def _files(line: str) -> list[str]:
    files = tomllib.loads(line)["test"]
    assert isinstance(files, list)
    return files


def with_lines_turned(project: Path) -> None:
    """Turn the order of the lines within each table of a project, and of its tables; the first lines stay first."""
    text = project.read_text(encoding="utf-8")
    head, *tables = text.split("\n[")
    turned = []
    for each in tables:
        title, *lines = each.strip().splitlines()
        turned.append("\n".join([f"[{title}", *lines[::-1]]))
    # A table's own table stays behind it: TOML asks for no more, but people do.
    turned.sort(key=lambda each: each.startswith("[plant"), reverse=True)
    project.write_text("\n".join([*head.strip().splitlines()[::-1], *turned, ""]), encoding="utf-8")


def with_columns_turned(project: Path) -> None:
    """Turn the order of the columns of every recording."""
    for path in project.parent.glob("*.csv"):
        rows = [line.split(",")[::-1] for line in path.read_text(encoding="utf-8").splitlines()]
        path.write_text("\n".join([*(",".join(row) for row in rows), ""]), encoding="utf-8")


def essence(written: Mapping[str, Any]) -> Any:
    """Return what may not depend on test recordings or on an order: the finding, and the plant that is written."""
    if "status" in written:
        return written
    found = json.loads(written["diagnosis.json"])
    for key in ABOUT_TESTS:
        found[key].pop("test", None)
    for key in ("notes", "says"):  # sentences may speak of test recordings
        found.pop(key, None)
    return found, tomllib.loads(written["project.toml"])["plant"]


CIRCUMSTANCES: Mapping[str, tuple[Callable[[Path], None], Callable[[int], None], int]] = {
    "again": (lambda project: None, at_full_speed, 0),
    "beside two busy loops": (lambda project: None, at_full_speed, 2),
    "at half speed": (lambda project: None, at_half_speed, 0),
    "without test recordings": (without_tests, at_full_speed, 0),
    "test recordings turned": (with_tests_turned, at_full_speed, 0),
    "lines turned": (with_lines_turned, at_full_speed, 0),
    "columns turned": (with_columns_turned, at_full_speed, 0),
}
TO_THE_BYTE = ("again", "beside two busy loops", "at half speed")


def compared(case: Path, place: Path, chosen: Sequence[str]) -> Mapping[str, str]:
    """Diagnose a case in each circumstance; return what differs from the first time: nothing, or the parts."""
    # The improved project names its recordings from where it stands: each diagnosis gets a place that looks alike.
    first = diagnosed(copied(case, place / "first" / "case"), place / "first" / "out", at_full_speed)
    found = {}
    for k, name in enumerate(chosen):
        change, driven, loops = CIRCUMSTANCES[name]
        project = copied(case, place / f"{k}" / "case")
        change(project)
        with busy(loops):
            other = diagnosed(project, place / f"{k}" / "out", driven)
        found[name] = difference(first, other, name in TO_THE_BYTE)
    return found


def difference(first: Mapping[str, Any], other: Mapping[str, Any], to_the_byte: bool) -> str:
    """Name what differs between two diagnoses: files to the byte, or else the keys of what counts."""
    if first.keys() != other.keys():
        return "another end"
    if to_the_byte:
        return ", ".join(name for name in first if first[name] != other[name])
    one, two = essence(first), essence(other)
    if "status" in first:
        return "" if one == two else "another end"
    keys = [key for key in one[0] if one[0][key] != two[0].get(key)]
    return ", ".join([*keys, *(["plant"] if one[1] != two[1] else [])])


def main() -> int:
    """Print a line a case and circumstance; the exit status is 1 where anything differs."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--count", type=int, default=3)
    parser.add_argument("--only", nargs="*", choices=list(CIRCUMSTANCES), default=list(CIRCUMSTANCES))
    parser.add_argument("--lines", type=Path, help="file of JSON lines to go on with")
    asked = parser.parse_args()
    done: dict[str, dict[str, str]] = {}
    if asked.lines and asked.lines.is_file():
        for line in asked.lines.read_text(encoding="utf-8").splitlines():
            done.update(json.loads(line))
    for seed in range(asked.seed, asked.seed + asked.count):
        name = f"{seed:06d}"
        if name not in done:
            with tempfile.TemporaryDirectory() as place:
                case = Path(place) / "case"
                simulated.write(seed, "any", 2, case)
                done[name] = dict(compared(case, Path(place), asked.only))
            if asked.lines:
                with asked.lines.open("a", encoding="utf-8") as stream:
                    stream.write(json.dumps({name: done[name]}) + "\n")
        for circumstance, differs in done[name].items():
            print(f"{name}  {circumstance:26} {differs or 'the same'}", flush=True)
    alike = [not differs for each in done.values() for differs in each.values()]
    print(f"the same: {sum(alike)} of {len(alike)}")
    return int(not all(alike))


if __name__ == "__main__":
    raise SystemExit(main())

"""Take power or room away at any change that a command makes to a file, and hold what is left against whole results."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from firmloop.cli import main
from tests.fuzz.failing import DEAD, count_calls, count_changes, without_memory, without_power, without_room

CALLS = 24
Command = Callable[[str, Path], list[str]]  # project file, place of the results


@dataclass(frozen=True, slots=True)
class Bench:
    """A folder with two projects, x.toml and old.toml, whose results differ, and a command that is run on them.

    `ending` is that of the results: a folder's has none.
    """

    folder: Path
    command: Command
    ending: str

    def place(self, name: str) -> Path:
        """Return a place for results."""
        return self.folder / f"{name}{self.ending}"

    def run(self, project: str, name: str) -> dict[str, bytes]:
        """Run the command undisturbed; return its results."""
        assert main(self.command(project, self.place(name))) == 0
        return held(self.place(name))

    def changes(self, name: str) -> int:
        """Return how often the command changes a file."""
        status, changes = count_changes(self.command("x.toml", self.place(name)))
        assert status == 0 and changes > 3
        return changes


def held(place: Path) -> dict[str, bytes]:
    """Return what a reader finds: every file of a folder but those that begin with a dot, or the file itself."""
    if place.is_file():
        return {"": place.read_bytes()}
    return {path.name: path.read_bytes() for path in place.glob("[!.]*") if path.is_file()} if place.exists() else {}


def lose_power(bench: Bench, again: bool, every: int) -> int:
    """Lose power at every so manieth change, in a new place or over older results; return how often that was done."""
    new, old = bench.run("x.toml", "new"), bench.run("old.toml", "old") if again else {}
    if again:
        bench.run("old.toml", "counted")
    times = _places(bench.changes("counted"), every)
    for at in times:
        lose_power_once(bench, at, new, old)
    assert not list(bench.folder.rglob(".*")), "the next run sweeps what is left"
    return len(times)


def lose_power_once(bench: Bench, at: int, new: dict[str, bytes], old: dict[str, bytes]) -> None:
    """Lose power before change number `at`, over older results where there are any: what is left is whole, old or new.

    The next run there is clean.
    """
    name = f"out{at}"
    if old:
        bench.run("old.toml", name)
    assert without_power(bench.command("x.toml", bench.place(name)), at) == DEAD
    left = held(bench.place(name))
    for file, content in left.items():
        assert content in (new.get(file), old.get(file)), f"{file} is half-written"
    if any(file.endswith(".json") and content != old.get(file) for file, content in left.items()):
        assert _others(left, new) == _others(new, new), "a document speaks of files that are not there"
    assert bench.run("x.toml", name) == new, "the next run is not clean"


def lose_room(bench: Bench, every: int) -> int:
    """Let the disk be full from every so manieth change on: told in a sentence, nothing changed; return how often."""
    times = _places(bench.changes("counted"), every)
    for at in times:
        place = bench.place(f"full{at}")
        status = without_room(bench.command("x.toml", place), at)
        # A run that is whole was refused to take leftovers away, or to keep what is only there to be quick next time.
        whole = status == 0 and held(place) == held(bench.place("counted"))
        assert whole or (status in (2, 3) and not held(place)), f"change {at}: status {status}, {sorted(held(place))}"
    return len(times)


def lose_memory(bench: Bench, every: int) -> int:
    """Let memory run out in one of CALLS calls, spread over the run: told in a sentence, nothing changed."""
    whole, calls = bench.run("x.toml", "counted"), count_calls(bench.command("x.toml", bench.place("called")))
    times = [calls * k // (CALLS + 1) for k in range(1, CALLS + 1, every)]
    for at in times:
        place = bench.place(f"short{at}")
        status = without_memory(bench.command("x.toml", place), at)
        found = held(place)
        # What only looks whether something is there takes a failure for a no, and the run goes on without it.
        assert status in (0, 2, 3) and (found == whole if status == 0 else not found), f"call {at}: status {status}"
    return len(times)


def _places(changes: int, every: int) -> range:
    return range(1, changes + 1, every)


def _others(files: dict[str, bytes], among: dict[str, bytes]) -> dict[str, bytes]:
    return {name: content for name, content in files.items() if name in among and not name.endswith(".json")}

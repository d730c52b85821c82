"""Without power or room at any change of any file: nothing is half-written, and the next run is clean."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from firmloop.cli import main
from tests.fuzz.failing import DEAD, count_changes, without_power, without_room
from tests.fuzz.projects import ROOT

EXAMPLE = ROOT / "examples" / "wheel_speed"
EXPERIMENT = """
[experiment]
signal = "prbs"
low = -6
high = 6
period_s = 0.01
duration_s = 2
"""
VERBS = ("excite",)  # the quickest that writes documents beside other files; all go through firmloop/output.py


@pytest.fixture
def project(tmp_path: Path) -> Path:
    for recording in EXAMPLE.glob("*.csv"):
        (tmp_path / recording.name).write_bytes(recording.read_bytes())
    text = (EXAMPLE / "wheel_speed.toml").read_text()
    (tmp_path / "x.toml").write_text(text + EXPERIMENT)
    (tmp_path / "old.toml").write_text(re.sub(r"tau_c_s = [\d.]+", "tau_c_s = 0.02", text) + EXPERIMENT)
    return tmp_path


def held(folder: Path) -> dict[str, bytes]:
    """Return what a reader finds in a folder: every file but those that begin with a dot."""
    return {path.name: path.read_bytes() for path in folder.glob("[!.]*")} if folder.exists() else {}


@pytest.mark.parametrize("verb", VERBS)
@pytest.mark.parametrize("again", [False, True], ids=["first", "again"])
def test_a_power_loss_leaves_nothing_half_written(verb: str, again: bool, project: Path) -> None:
    def command(name: str, out: str) -> list[str]:
        return [verb, str(project / name), "--out", str(project / out)]

    assert main(command("x.toml", "new")) == 0
    assert main(command("old.toml", "old")) == 0
    new, old = held(project / "new"), held(project / "old") if again else {}
    # The same folder's name, for it stands in what is written.
    status, changes = count_changes(command("x.toml", "counted"))
    assert status == 0 and changes > 3
    for at in range(1, changes + 1):
        out = f"out{at}"
        if again:
            assert main(command("old.toml", out)) == 0
        assert without_power(command("x.toml", out), at) == DEAD
        left = held(project / out)
        for name, content in left.items():
            assert content in (new.get(name), old.get(name)), f"{name} is half-written"
        if any(name.endswith(".json") and content != old.get(name) for name, content in left.items()):
            assert {n: c for n, c in left.items() if n in new and not n.endswith(".json")} == {
                n: c for n, c in new.items() if not n.endswith(".json")
            }, "a document speaks of files that are not there"
        assert main(command("x.toml", out)) == 0
        assert held(project / out) == new
    assert not list(project.rglob(".*")), "the next run sweeps what is left"


@pytest.mark.parametrize("verb", VERBS)
def test_a_full_disk_is_told_and_changes_nothing(verb: str, project: Path) -> None:
    status, changes = count_changes([verb, str(project / "x.toml"), "--out", str(project / "counted")])
    assert status == 0
    for at in range(1, changes + 1):
        out = project / f"out{at}"
        status = without_room([verb, str(project / "x.toml"), "--out", str(out)], at)
        whole = status == 0 and held(out) == held(project / "counted")  # what was refused was to take leftovers away
        assert whole or (status in (2, 3) and not held(out))

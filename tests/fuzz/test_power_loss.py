"""Without power or room at any change of any file: nothing is half-written, and the next run is clean."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.fuzz.losses import Bench, lose_memory, lose_power, lose_room
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
# The quickest verbs that write documents beside other files; all go through firmloop/output.py, and
# `bench/host/power_loss.py` sweeps every one of them. Generating changes fifty files; every eighth is tried here.
VERBS = {"excite": 1, "generate": 8}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for recording in EXAMPLE.glob("*.csv"):
        (tmp_path / recording.name).write_bytes(recording.read_bytes())
    text = (EXAMPLE / "wheel_speed.toml").read_text()
    (tmp_path / "x.toml").write_text(text + EXPERIMENT)
    (tmp_path / "old.toml").write_text(re.sub(r"tau_c_s = [\d.]+", "tau_c_s = 0.02", text) + EXPERIMENT)
    return tmp_path


def bench(verb: str, folder: Path) -> Bench:
    return Bench(folder, lambda project, place: [verb, str(folder / project), "--out", str(place)], "")


@pytest.mark.parametrize(
    ("verb", "again"),
    [
        pytest.param("excite", False, id="excite for the first time"),
        pytest.param("excite", True, id="excite again"),
        pytest.param("generate", False, id="generate for the first time"),
        pytest.param("generate", True, id="generate again", marks=pytest.mark.slow),
    ],
)
def test_a_power_loss_leaves_nothing_half_written(verb: str, again: bool, folder: Path) -> None:
    assert lose_power(bench(verb, folder), again, VERBS[verb]) > 3


@pytest.mark.parametrize("verb", VERBS)
def test_a_full_disk_is_told_and_changes_nothing(verb: str, folder: Path) -> None:
    assert lose_room(bench(verb, folder), VERBS[verb]) > 3


@pytest.mark.parametrize("verb", VERBS)
def test_no_memory_is_told_and_changes_nothing(verb: str, folder: Path) -> None:
    assert lose_memory(bench(verb, folder), 1) > 3

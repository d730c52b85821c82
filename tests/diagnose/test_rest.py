"""A load and a sensor's offset are one function of a speed, but not where the recordings begin at rest."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from bench.blind_cases import draw_case, write_case
from firmloop.cli import main

OFFSET, LOAD = 440098, 410094  # seeds of cases with a speed alone
IN_MOTION = 1300  # rows after which these machines move


@pytest.mark.parametrize(
    ("seed", "skipped", "verdict", "names"),
    [
        pytest.param(OFFSET, 0, "explained", "sensor_offset", id="it reads that much at rest"),
        pytest.param(LOAD, 0, "explained", "load_torque", id="it reads nothing at rest"),
        pytest.param(OFFSET, IN_MOTION, "ambiguous", "load_torque sensor_offset", id="it began in motion"),
    ],
)
def test_where_recordings_begin(seed: int, skipped: int, verdict: str, names: str, tmp_path: Path) -> None:
    folder = tmp_path / "case"
    write_case(draw_case(seed), folder, tmp_path / "labels")
    for part in ("train.csv", "test.csv"):
        head, *rows = (folder / part).read_text(encoding="utf-8").splitlines()
        (folder / part).write_text("\n".join([head, *rows[skipped:], ""]), encoding="utf-8")
    assert main(["diagnose", str(folder / "project.toml"), "--out", str(tmp_path / "out")]) == 1
    said = json.loads((tmp_path / "out" / "diagnosis.json").read_text(encoding="utf-8"))
    assert (said["verdict"], {each["name"] for each in said["effects"]}) == (verdict, set(names.split()))

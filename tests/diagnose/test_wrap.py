"""A reading that wraps around is unrolled, slow or quick, and its range is read off to a fraction of its noise."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from bench.blind_cases import draw_case, write_case
from firmloop.cli import main


# A quick current; a speed; quick up, slow down; a current whose nominal plant says too little of it.
@pytest.mark.parametrize("seed", [32069, 31020, 160018, 240075])
def test_wraps_are_read_off(tmp_path: Path, seed: int) -> None:
    case = draw_case(seed)
    (hidden,) = case.hidden
    assert hidden.name == "sensor_wrap"
    write_case(case, tmp_path / "case", tmp_path / "labels")
    assert main(["diagnose", str(tmp_path / "case" / "project.toml"), "--out", str(tmp_path / "out")]) == 1
    said = json.loads((tmp_path / "out" / "diagnosis.json").read_text(encoding="utf-8"))
    assert said["verdict"] == "explained"
    (effect,) = said["effects"]
    assert effect["name"] == "sensor_wrap"
    (found,) = [each for name, each in effect["parameters"].items() if name.startswith("range_")]
    assert found["value"] == pytest.approx(hidden.told["range"], rel=2e-3)

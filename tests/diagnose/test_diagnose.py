"""Concealed physics is named, nothing is invented, and the results can be used as they are."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path

import pytest

from firmloop.cli import main
from tests.diagnose.cases import concealed, diagnosis


def test_friction_is_named_in_colored_noise(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    status, said = diagnosis(concealed(tmp_path, "coulomb_friction", 0.3, True), tmp_path / "out")
    assert status == 1
    assert said["verdict"] == "explained" and said["half"] == "plant"
    (effect,) = said["effects"]  # type: ignore[misc]
    assert effect["name"] == "coulomb_friction"
    label = json.loads((tmp_path / "labels" / "label.json").read_text(encoding="utf-8"))
    truth = label["effects"]["coulomb_friction"]["torque"]
    low, high = effect["parameters"]["torque_N_m"]["ci95"]
    assert low < truth < high
    assert said["fit"]["test"]["after"] < 1.3 < said["fit"]["test"]["refit"]  # type: ignore[index]
    assert "coulomb_friction" in capsys.readouterr().out
    assert "<svg" in (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    (written,) = tomllib.loads((tmp_path / "out" / "project.toml").read_text(encoding="utf-8"))["plant"]["effects"]
    assert written["torque_N_m"]["free"] and written["torque_N_m"]["ci95"] == pytest.approx([low, high], rel=1e-4)
    # The improved project predicts the unseen recording as it is.
    predicted = tmp_path / "predicted.csv"
    arguments = [str(tmp_path / "out" / "project.toml"), str(tmp_path / "case" / "test.csv")]
    assert main(["simulate", *arguments, "--out", str(predicted)]) == 0


@pytest.mark.parametrize("colored", [False, True])
def test_nothing_is_invented(tmp_path: Path, colored: bool) -> None:
    status, said = diagnosis(concealed(tmp_path, "", 1.0, colored), tmp_path / "out")
    assert status == 0
    assert said["verdict"] == "no_mismatch"
    assert said["effects"] == []


@pytest.mark.slow
@pytest.mark.parametrize("name", ["quadratic_drag", "brush_drop", "input_delay", "dead_zone"])
def test_single_effects_are_named(tmp_path: Path, name: str) -> None:
    _, said = diagnosis(concealed(tmp_path, name, 0.3, False), tmp_path / "out")
    names = [effect["name"] for effect in said["effects"]]  # type: ignore[attr-defined]
    assert said["verdict"] == "explained" and names == [name]

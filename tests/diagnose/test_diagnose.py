"""Concealed physics is named, nothing is invented, and the results can be used as they are."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from firmloop.cli import main
from tests.conftest import Once
from tests.diagnose.cases import concealed, concealed_once, said_of
from tests.firmloop.columns.test_identify_says import written


def test_friction_is_named_in_colored_noise(once: Once, tmp_path: Path) -> None:
    made = concealed_once(once, "coulomb_friction", True)
    folder, said = made.folder, made.said
    assert made.status == 1
    assert said["verdict"] == "explained" and said["half"] == "plant"
    (effect,) = said["effects"]  # type: ignore[misc]
    assert effect["name"] == "coulomb_friction"
    label = json.loads((folder / "labels" / "label.json").read_text(encoding="utf-8"))
    truth = label["effects"]["coulomb_friction"]["torque"]
    low, high = effect["parameters"]["torque_N_m"]["ci95"]
    assert low < truth < high
    assert said["fit"]["test"]["after"] < 1.3 < said["fit"]["test"]["refit"]  # type: ignore[index]
    assert "coulomb_friction" in made.printed
    assert "<svg" in (folder / "out" / "report.html").read_text(encoding="utf-8")
    (written,) = tomllib.loads((folder / "out" / "project.toml").read_text(encoding="utf-8"))["plant"]["effects"]
    assert written["torque_N_m"]["free"] and written["torque_N_m"]["ci95"] == pytest.approx([low, high], rel=1e-4)
    # The improved project predicts the unseen recording as it is.
    predicted = tmp_path / "predicted.csv"
    arguments = [str(folder / "out" / "project.toml"), str(folder / "case" / "test.csv")]
    assert main(["simulate", *arguments, "--out", str(predicted)]) == 0


@pytest.mark.parametrize("colored", [False, True])
def test_nothing_is_invented(once: Once, colored: bool) -> None:
    made = concealed_once(once, "", colored)
    said = made.said
    assert made.status == 0
    assert said["verdict"] == "no_mismatch"
    assert said["effects"] == []


@pytest.mark.parametrize(
    ("verdict", "status"), [("no_mismatch", 0), ("explained", 1), ("ambiguous", 1), ("unknown_physics", 1)]
)
def test_a_verdict_of_what_is_missing_has_exit_status_1(
    verdict: str, status: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    finding = SimpleNamespace(verdict=verdict, says=(), as_dict=dict)
    made = SimpleNamespace(finding=finding, files=lambda folder: {})
    monkeypatch.setattr("firmloop.door.load.load", lambda path: None)
    monkeypatch.setattr("firmloop.door.diagnose.diagnose", lambda project, stage: made)
    assert main(["diagnose", "project.toml", "--out", str(tmp_path / "out")]) == status


@pytest.mark.slow
@pytest.mark.parametrize("name", ["quadratic_drag", "brush_drop", "input_delay", "dead_zone"])
def test_single_effects_are_named(tmp_path: Path, name: str) -> None:
    said = said_of(concealed(tmp_path, name, 0.3, False))
    names = [effect["name"] for effect in said["effects"]]  # type: ignore[attr-defined]
    assert said["verdict"] == "explained" and names == [name]


def test_no_next_candidate_is_one_that_the_recordings_cannot_test(tmp_path: Path) -> None:
    """A shaft that turns one way, and rests at times: a load is friction to it, as long as it turns."""
    rng, step, speed, turning = np.random.default_rng(24), 0.02, [], 3.0
    drive = np.repeat(rng.choice([0.25, 0.36, 0.44], 300), rng.integers(2, 30, 300))[:1500]
    for torque in drive:
        speed.append(turning + rng.normal(0.0, 0.03))
        for _ in range(20):
            turning = max(turning + step / 20 * (63.5 * torque - 2.14 * turning - 19.4), 0.0)
    parameters = {"J_kg_m2": {"value": 0.02, "free": True}, "b_N_m_s_rad": {"value": 0.05, "free": True}}
    outputs = ["speed_rad_s"]
    table = {"kind": "rotary_stage", "input": "torque_N_m", "outputs": outputs, "parameters": parameters}
    made = (table, step * np.arange(len(drive)), {"torque_N_m": drive, "speed_rad_s": speed})
    said = said_of(written(tmp_path / "one_way", made) / "project.toml")
    assert [each["name"] for each in said["effects"]] == ["coulomb_friction"]
    others = {each["name"] for each in said["alternatives"]}
    assert others and "load_torque" in said["untestable"] and not others & set(said["untestable"])

"""Figures of a loop carry the intervals of the plant that they rest on."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from firmloop.cli import main
from firmloop.design.analysis.loop import margins
from firmloop.identify.plants.kinds import make_plant
from firmloop.identify.simulation.linearize import linearize
from firmloop.project.project import read_project
from firmloop.stages.making import design
from firmloop.stages.plant import plant_of


def test_margins_hold_those_of_the_true_plant(
    project: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    fitted, out = tmp_path / "fitted", tmp_path / "out"
    assert main(["identify", str(project), "--out", str(fitted)]) == 0
    assert main(["design", str(fitted / "project.toml"), "--out", str(out)]) == 0
    said, document = capsys.readouterr().out, json.loads((out / "design.json").read_text())
    half, found = document["ci95_half"], document["margins"]
    read = read_project(fitted / "project.toml")
    values = {"gain": 3.0, "time_constant_s": 2.0, "delay_s": 0.0}
    truth = margins(design(read, plant_of(read)).law, linearize(make_plant("first_order", "u", ["y"], values)))
    for name in ("phase_margin_deg", "gain_margin_db", "sensitivity_peak", "crossover_rad_s"):
        assert 0.0 < half[name] < 0.01 * found[name]
        assert abs(found[name] - getattr(truth, name)) < 2.0 * half[name]
    line = next(line for line in said.splitlines() if "phase margin" in line)
    assert f"± {half['phase_margin_deg']:.2g} deg" in line and "each parameter for itself" in said


def test_a_plant_without_intervals_has_three_digits(
    project: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["design", str(project), "--out", str(tmp_path / "out")]) == 0
    assert "±" not in capsys.readouterr().out
    assert json.loads((tmp_path / "out" / "design.json").read_text())["ci95_half"] == {}


def test_tune_shows_no_digit_beyond_the_interval(
    project: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = project.read_text().replace("gain = { value = 1.0", "gain = { ci95 = [0.5, 1.5], value = 1.0")
    project.write_text(text + '\n[tuning]\nrules = ["simc"]\n')
    assert main(["tune", str(project), "--out", str(tmp_path / "out")]) == 0
    said = capsys.readouterr().out
    (entry,) = json.loads((tmp_path / "out" / "tuning.json").read_text())["rules"]
    peak, half = entry["margins"]["sensitivity_peak"], entry["ci95_half"]["sensitivity_peak"]
    assert half > 0.1 and f" {peak:.2g} " in said and f" {peak:.3g} " not in said
    assert "no more digits than" in said

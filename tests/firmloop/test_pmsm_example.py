"""The example of a permanent-magnet machine: from the log that its script makes to C that agrees on every target."""

from __future__ import annotations

import json
import runpy
import shutil
import tomllib
from pathlib import Path

import pytest

from firmloop.cli import main

FOLDER = Path(__file__).parents[2] / "examples" / "pmsm_foc"
TRUTH = {"R_ohm": 0.36, "Ld_H": 0.2e-3, "Lq_H": 0.33e-3, "flux_Wb": 6.4e-3, "J_kg_m2": 4.8e-6, "b_N_m_s_rad": 1.0e-5}


def ran(folder: Path, monkeypatch: pytest.MonkeyPatch, *more: str) -> dict[str, object]:
    """Run the project in a folder of its own; return the plant that it found."""
    shutil.copytree(FOLDER, folder, dirs_exist_ok=True)
    monkeypatch.chdir(folder)
    runpy.run_path(str(folder / "make_recordings.py"), run_name="__main__")
    assert main(["run", "spindle.toml", "--out", "out", "--steps", "2000", *more]) == 0
    verdict = json.loads((folder / "out" / "verdict.json").read_text())
    assert (verdict["verdict"], verdict["differences"]) == ("agrees", 0)
    return dict(tomllib.loads((folder / "out" / "project.toml").read_text())["plant"]["parameters"])


def test_its_machine_is_found_and_its_c_agrees(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """On this machine, and on the emulated microcontroller where there is one."""
    emulated = all(shutil.which(tool) for tool in ("arm-none-eabi-gcc", "qemu-system-arm"))
    found = ran(tmp_path, monkeypatch, *(() if emulated else ("--target", "host")))
    if emulated:
        assert json.loads((tmp_path / "out" / "verdict_qemu_mps2_an386.json").read_text())["verdict"] == "agrees"
    for name, truth in TRUTH.items():
        entry = found[name]
        assert isinstance(entry, dict)
        low, high = entry["ci95"]
        assert abs(entry["value"] - truth) < high - low, name


def test_the_gains_it_was_tuned_to_can_be_kept(tmp_path: Path) -> None:
    """What `design` writes is a project of its own: gains for the rule, and the same law."""
    shutil.copytree(FOLDER, tmp_path, dirs_exist_ok=True)
    first, second = tmp_path / "first", tmp_path / "second"
    for name in ("steps", "switched", "triangle"):
        (tmp_path / f"{name}.csv").write_text("time_s\n")
    assert main(["design", str(tmp_path / "spindle.toml"), "--out", str(first)]) == 0
    kept = tomllib.loads((first / "project.toml").read_text())["controller"]
    assert "tune" not in kept and "bandwidth_rad_s" not in kept and kept["kp_q"] > 0
    assert main(["design", str(first / "project.toml"), "--out", str(second)]) == 0
    again = tomllib.loads((second / "project.toml").read_text())["controller"]
    assert again == kept

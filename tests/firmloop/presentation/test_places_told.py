"""An effect that could act at several bodies is told with the one it acts at, the first one too."""

from __future__ import annotations

import csv
import json
import tomllib
from pathlib import Path

import numpy as np
import pytest

from firmloop.cli import main

PROJECT = """\
schema = 1
name = "two"
[recordings]
train = ["a.csv"]
PER_RECORDING
[plant]
kind = "ode"
states = ["w1_rad_s", "w2_rad_s", "p1_rad", "p2_rad"]
inputs = ["torque_N_m"]
[plant.outputs]
w1_rad_s = "w1_rad_s"
w2_rad_s = "w2_rad_s"
[plant.derivatives]
w1_rad_s = "(torque_N_m - k_N_m_rad*(p1_rad-p2_rad) - d_N_m_s_rad*(w1_rad_s-w2_rad_s) - b1_N_m_s_rad*w1_rad_s)/J1_kg_m2"
w2_rad_s = "(k_N_m_rad*(p1_rad-p2_rad) + d_N_m_s_rad*(w1_rad_s-w2_rad_s) - b2_N_m_s_rad*w2_rad_s)/J2_kg_m2"
p1_rad = "w1_rad_s"
p2_rad = "w2_rad_s"
[plant.parameters]
J1_kg_m2 = { value = 1e-3, free = false }
J2_kg_m2 = { value = 2e-3, free = false }
k_N_m_rad = { value = 4.0 }
d_N_m_s_rad = { value = 0.01 }
b1_N_m_s_rad = { value = 0.002 }
b2_N_m_s_rad = { value = 0.004 }
"""
FRICTION = """
[[plant.effects]]
name = "coulomb_friction"
at = "w1_rad_s"
torque_N_m = { value = FIRST }
[[plant.effects]]
name = "coulomb_friction"
at = "w2_rad_s"
torque_N_m = { value = SECOND }
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Leave a recording of two bodies, of which the first rubs by 0.02 N*m, and noise of 0.05 rad/s."""
    random = np.random.default_rng(4)
    drive = np.repeat(random.uniform(-0.2, 0.2, 40), 50)
    header = "time_s,torque_N_m,w1_rad_s,w2_rad_s"
    rows = [f"{0.002 * k:.3f},{u:.6g},0,0" for k, u in enumerate(drive)]
    (tmp_path / "a.csv").write_text("\n".join([header, *rows]))
    written(tmp_path, 0.02, 0.0)
    assert (
        main(["simulate", str(tmp_path / "two.toml"), str(tmp_path / "a.csv"), "--out", str(tmp_path / "b.csv")]) == 0
    )
    with (tmp_path / "b.csv").open() as stream:
        simulated = list(csv.DictReader(stream))
    for row in simulated:
        for name in ("w1_rad_s", "w2_rad_s"):
            row[name] = f"{float(row[name]) + 0.05 * random.normal():.6g}"
    (tmp_path / "a.csv").write_text("\n".join([header, *(",".join(row.values()) for row in simulated)]))
    return tmp_path


def written(folder: Path, *torques: float, per_recording: str = "") -> Path:
    text = FRICTION.replace("FIRST", str(torques[0])).replace("SECOND", str(torques[1])) if torques else ""
    path = folder / "two.toml"
    path.write_text(PROJECT.replace("PER_RECORDING", per_recording) + text)
    return path


def test_identify_names_the_place_of_each_friction(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, out = written(folder, 0.01, 0.01), folder / "out"
    assert main(["identify", str(path), "--out", str(out)]) == 0
    said = capsys.readouterr().out
    assert "  coulomb_friction.w1_rad_s.torque_N_m  0.0" in said and "coulomb_friction.w2_rad_s.torque_N_m" in said
    assert "coulomb_friction.torque_N_m" not in said
    note = "coulomb_friction.w2_rad_s.torque_N_m cannot be told from 0"
    assert note in said
    entries = tomllib.loads((out / "project.toml").read_text())["plant"]["effects"]
    assert {entry["at"]: round(entry["torque_N_m"]["value"], 3) for entry in entries} == {
        "w1_rad_s": 0.02,
        "w2_rad_s": pytest.approx(0.0, abs=0.001),
    }
    assert main(["identify", str(out / "project.toml"), "--out", str(folder / "again")]) == 0
    assert "coulomb_friction.w1_rad_s.torque_N_m" in capsys.readouterr().out


@pytest.mark.parametrize("name", ["coulomb_friction.torque_N_m", "coulomb_friction.w1_rad_s.torque_N_m"])
def test_a_name_is_read_with_and_without_the_place_of_the_first(
    name: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = written(folder, 0.01, 0.01, per_recording=f'per_recording = ["{name}"]')
    assert main(["simulate", str(path), str(folder / "a.csv"), "--out", str(folder / "c.csv")]) == 0
    assert f"{name} is 0.0" in capsys.readouterr().out


def test_diagnose_names_the_place_of_a_friction_at_the_first_body(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = folder / "out"
    assert main(["diagnose", str(written(folder)), "--out", str(out)]) == 1
    assert "and holds the shaft at rest (w1_rad_s): torque_N_m 0.0" in capsys.readouterr().out
    (found,) = json.loads((out / "diagnosis.json").read_text())["effects"]
    assert (found["name"], found["at"]) == ("coulomb_friction", "w1_rad_s")
    assert found["parameters"]["torque_N_m"]["value"] == pytest.approx(0.02, rel=0.05)
    assert set(found["parameters"]) == {"torque_N_m"}
    (entry,) = tomllib.loads((out / "project.toml").read_text())["plant"]["effects"]
    assert (entry["name"], entry["at"]) == ("coulomb_friction", "w1_rad_s")
    assert "coulomb_friction of w1_rad_s" in (out / "report.html").read_text()

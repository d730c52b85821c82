"""`firmloop datasheet` writes a plant that is one, with all that the project had, or says why it is none."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

from firmloop.cli import main

DC = """\
terminal_resistance = "2.5 ohm"
terminal_inductance = "0.4 mH"
torque_constant = "37 mNm/A"
rotor_inertia = "12 gcm²"
damping = "3e-6 Nms"
"""
PMSM = """\
phase_to_phase_resistance = "0.45 ohm"
phase_to_phase_inductance = "0.2 mH"
kv = "170 rpm/V"
pole_pairs = 7
rotor_inertia = "50 kg mm²"
damping = "1e-5 Nms"
"""
AXES = 'inputs = ["voltage_d_V", "voltage_q_V"]'


def read(folder: Path, kind: str, ends: str, sheet: str, more: str = "") -> int:
    outputs = "" if "outputs" in ends else 'outputs = ["speed_rad_s"]'
    text = f'schema = 1\nname = "motor"\n[plant]\nkind = "{kind}"\n{ends}\n{outputs}\n{more}\n[datasheet]\n{sheet}'
    (folder / "p.toml").write_text(text, encoding="utf-8")
    return main(["datasheet", str(folder / "p.toml"), "--out", str(folder / "out")])


def test_what_no_sheet_says_stays(tmp_path: Path) -> None:
    more = """\
[plant.parameters]
gear_ratio = 20
R_ohm = { value = 2.0, free = true }
[[plant.effects]]
name = "coulomb_friction"
torque_N_m = 1e-4
"""
    assert read(tmp_path, "dc_motor", 'input = "voltage_V"', DC, more) == 0
    plant = tomllib.loads((tmp_path / "out" / "project.toml").read_text(encoding="utf-8"))["plant"]
    assert plant["parameters"]["gear_ratio"] == 20 and plant["parameters"]["R_ohm"]["value"] == 2.5
    assert plant["effects"] == [{"name": "coulomb_friction", "torque_N_m": 1e-4}]


@pytest.mark.parametrize(
    ("ends", "words"),
    [
        ('input = "voltage_V"', "pmsm is driven by inputs = [voltage_d_V, voltage_q_V]"),
        (AXES + '\noutputs = ["speed"]', "plant.outputs: 'speed' is unknown to pmsm"),
    ],
)
def test_ends_that_a_kind_does_not_have_are_refused(
    ends: str, words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert read(tmp_path, "pmsm", ends, PMSM) == 2
    assert words in capsys.readouterr().err
    assert not [*tmp_path.rglob("project.toml")]


@pytest.mark.parametrize(
    ("figure", "words"),
    [
        ("pole_pairs = 7.5", "datasheet.pole_pairs is 7.5; it is counted, so that it must be a whole number"),
        ("poles = 13", "datasheet.poles is 13; it is counted, so that it must be an even number"),
    ],
)
def test_half_a_pole_pair_is_refused(
    figure: str, words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert read(tmp_path, "pmsm", AXES, PMSM.replace("pole_pairs = 7", figure)) == 2
    assert words in capsys.readouterr().err


def test_what_is_counted_is_exact(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The flux is off by what kv is, and by nothing of the pole pairs."""
    assert read(tmp_path, "pmsm", AXES, PMSM) == 0
    rows = {line.split()[0]: line.split()[1:4] for line in capsys.readouterr().out.splitlines() if line[:2] == "  "}
    assert rows["pole_pairs"][:2] == ["7", "printed"] and rows["flux_Wb"] == ["0.00463", "±", "0.00022"]


def test_a_range_is_no_figure(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert read(tmp_path, "dc_motor", 'input = "voltage_V"', DC.replace("2.5 ohm", "1.8\u20133.2 ohm")) == 2
    assert "write the number and its unit alone, without what stands from" in capsys.readouterr().err

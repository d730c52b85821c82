"""Sheets and bench tests of permanent-magnet machines: a hobby shop's sheet, benches with a known truth, intervals."""

from __future__ import annotations

import json
import math
import tomllib
from pathlib import Path

import numpy as np
import pytest

from firmloop.cli import main
from firmloop.identify.bench_tests.datasheets import read_sheet, sheets
from firmloop.identify.bench_tests.standard_tests import Measured
from firmloop.identify.error import IdentifyError
from firmloop.identify.recordings.recording import Recording, make_recording
from tests.motor_benches import FLUX, LD, LOST, LQ, PAIRS, B, J, R, bench

SHEET = sheets()["pmsm"]
HOBBY = {
    "poles": 14,
    "kv": "380 rpm/V",
    "phase_to_phase_resistance": "72 mohm",
    "phase_to_phase_inductance": "61 uH",
}


def test_a_hobby_sheet_is_read() -> None:
    """Kv of 380 rpm/V between terminals, 7 pole pairs: psi = 60/(sqrt(3) 2 pi Kv p)."""
    reading = read_sheet(SHEET, HOBBY, 0.05)
    assert reading.figures["flux"] == pytest.approx(60 / (math.sqrt(3) * 2 * math.pi * 380 * 7), rel=1e-9)
    assert reading.figures["phase_resistance"] == pytest.approx(0.036)
    assert reading.figures["d_axis_inductance"] == reading.figures["q_axis_inductance"] == pytest.approx(30.5e-6)
    assert not reading.contradictions


def test_star_and_delta_are_told_apart() -> None:
    """A winding in delta of 108 mohm shows 72 mohm between terminals, as one of 36 mohm in star does."""
    delta = {key: value for key, value in HOBBY.items() if "resistance" not in key}
    reading = read_sheet(SHEET, {**delta, "delta_winding_resistance": "108 mohm"}, 0.05)
    assert reading.figures["phase_resistance"] == pytest.approx(0.036)


@pytest.mark.parametrize(
    ("figure", "printed", "words"),
    [
        ("phase_resistance", "72 mohm", "a factor of 2, as between phase to phase and one phase"),
        ("phase_resistance", "108 mohm", "a factor of 3, as between a winding in delta and the star"),
        ("pole_pairs", 14, "a factor of 2, as between phase to phase and one phase, or poles and pole pairs"),
        ("kv_of_a_phase", "380 rpm/V", "line and phase"),
    ],
)
def test_what_contradicts_is_named(figure: str, printed: object, words: str) -> None:
    (found,) = read_sheet(SHEET, {**HOBBY, figure: printed}, 0.05).contradictions
    assert words in found.sentence(SHEET)


PROJECT = """schema = 1
name = "hobby"
[datasheet]
plant = "pmsm"
poles = 8
kv = "380 rpm/V"
[standard_tests.phase_to_phase]
voltage_V = [1.0, 2.0, 3.0, 4.0]
current_A = [0.90, 2.29, 3.69, 5.06]
[standard_tests.locked_d]
recording = "d.csv"
[standard_tests.locked_q]
recording = "q.csv"
[standard_tests.spin]
voltage_V = [1.57, 3.15, 6.26]
speed_rad_s = [50.0, 100.0, 200.0]
[standard_tests.alignment]
position_rad = [-0.05, 1.52, 3.09, 4.66]
[standard_tests.run_up]
recording = "run.csv"
"""


def test_the_tests_make_a_plant(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "p.toml").write_text(PROJECT)
    for name, columns in bench(np.random.default_rng(3)).items():
        table = np.column_stack(list(columns.values()))
        np.savetxt(tmp_path / f"{name}.csv", table, delimiter=",", header=",".join(columns), comments="", fmt="%.9g")
    out = tmp_path / "out"
    ended = main(["datasheet", str(tmp_path / "p.toml"), "--out", str(out)])
    said = capsys.readouterr().out
    assert ended == 0, said
    plant = tomllib.loads((out / "project.toml").read_text())["plant"]
    assert plant["inputs"] == ["voltage_d_V", "voltage_q_V"] and plant["parameters"]["pole_pairs"] == 4.0
    for name, truth in {"R_ohm": R, "Ld_H": LD, "Lq_H": LQ, "flux_Wb": FLUX, "J_kg_m2": J, "b_N_m_s_rad": B}.items():
        assert plant["parameters"][name]["value"] == pytest.approx(truth, rel=0.05), name
    effects = {entry["name"]: entry for entry in plant["effects"]}
    assert effects["dead_time"]["voltage_V"] == pytest.approx(LOST, rel=0.1)
    assert effects["angle_offset"]["offset_rad"] == pytest.approx(-0.2, abs=0.02)
    assert json.loads((out / "datasheet.json").read_text())["parameters"]["Lq_H"]["origin"] == "locked_q test"


def test_intervals_hold_the_truth() -> None:
    """In 60 benches each true value is in its interval about 57 times; fewer than 50 come once in two thousand."""
    truth = {"R_ohm": R, "Ld_H": LD, "Lq_H": LQ, "dead_time.voltage_V": LOST, "J_kg_m2": J, "b_N_m_s_rad": B}
    held = dict.fromkeys(truth, 0)
    for seed in range(60):
        for name, one in measured(bench(np.random.default_rng(seed))).items():
            if name in truth:
                held[name] += abs(one.value - truth[name]) < 1.96 * (one.deviation or 0.0)
    assert min(held.values()) >= 50, held


def measured(made: dict[str, dict[str, np.ndarray]]) -> dict[str, Measured]:
    found = {"pole_pairs": Measured(float(PAIRS), None), "flux_Wb": Measured(FLUX, None)}
    for name, test in (("d", "locked_d"), ("q", "locked_q"), ("run", "run_up")):
        found |= SHEET.tests[test].run(_as_recording(made[name]), found)
    return found


def _as_recording(columns: dict[str, np.ndarray]) -> Recording:
    return make_recording(columns["time_s"], {k: v for k, v in columns.items() if k != "time_s"}, "bench", "")


@pytest.mark.parametrize(
    ("name", "columns", "words"),
    [
        ("locked_d", {"time_s": np.arange(5.0), "voltage_d_V": np.ones(5), "current_d_A": np.ones(5)}, "5 rows"),
        ("run_up", {"time_s": np.arange(50.0), "current_q_A": np.ones(50), "speed_rad_s": np.ones(50)}, "run-up"),
    ],
)
def test_recordings_that_hold_nothing_are_named(name: str, columns: dict[str, np.ndarray], words: str) -> None:
    known = {"pole_pairs": Measured(4.0, None), "flux_Wb": Measured(FLUX, None)}
    with pytest.raises(IdentifyError, match=words):
        SHEET.tests[name].run(_as_recording(columns), known)

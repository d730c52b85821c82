"""Each small input on which an early build failed, by the name of its folder: today it comes out as its note asks.

The folders are no part of this repository; FIRMLOOP_CASES names them where they are not beside it.
"""

from __future__ import annotations

import json
import os
import re
import shutil
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from firmloop.cli import main

CASES = Path(os.environ.get("FIRMLOOP_CASES", Path(__file__).parents[4] / "shared" / "cases"))
CASE_42 = "42_exit_70"
SLOW = pytest.mark.slow

pytestmark = pytest.mark.skipif(not CASES.is_dir(), reason=f"no cases at {CASES.name}; set FIRMLOOP_CASES")


@dataclass(frozen=True, slots=True)
class Right:
    """How a command ends: its status, what it says (patterns), and fitted values with their relative tolerance."""

    command: str
    status: int
    says: tuple[str, ...] = ()
    values: Mapping[str, float] = field(default_factory=dict)
    near: float = 0.02


MOTOR = {"R_ohm": 2.5, "L_H": 1e-3, "ke_V_s_rad": 0.037, "J_kg_m2": 1.2e-5}
RIGHT = {
    "01_mV_min_off_by_2pi": Right("datasheet", 0, (r"ke_V_s_rad +0\.0183", r"kt_N_m_A +0\.0183")),
    "05_time_digits_lost": Right("identify", 2, ("has lost digits", "period_s = 5e-05", r"start_s = 10\.0")),
    "06_unit_lost_in_rename": Right("identify", 2, (r't_ms = \{ name = "time_s", unit = "ms" \}',)),
    "08_micros_wrap": Right("identify", 2, ("counter that wraps", r"wraps = 4294\.967296")),
    "09_trailing_comma": Right("identify", 0, ("every line ends with a delimiter",), MOTOR),
    "13_serial_garbage": Right("identify", 0, ("the header is line 2: 'Booting v1.2'",), MOTOR),
    "14_reversed_encoder": Right("identify", 0, ("speed_rad_s of log.csv runs against voltage_V", "turn the sign")),
    "15_ambient_offset": Right("identify", 0, (r"rests at 23\.4 degC", r"output_at_rest = \{ value = 23\.4")),
    "16_cooling_step_no_limit": Right("design", 0, (r"kp -5\.769", r"rise time 10-90 % +16\.5 s", "about output 50")),
    "21_butterworth8_called_unstable": Right("design", 0, ("4 sections",)),
    "22_unit_m3_s_read_as_s": Right("design", 0, (r"m\^3/s/m", "closed loop +stable")),
    "25_arx_delay_not_told": Right("model", 0, (r"delay 0\.18 s", r"gain at rest +1\.000", "9 samples of delay")),
    "26_model_offset": Right("model", 2, (r"1\.44 and 4\.14", r'remove_offset = \["drive_V", "position_rad"\]')),
    "27_single_sine": Right("model", 2, ("excites 2 directions", "firmloop excite")),
    "28_units_as_printed": Right(
        "datasheet", 0, (r"R_ohm +2\.50 ", r"L_H +0\.000400 ", r"kt_N_m_A +0\.0370 ", r"J_kg_m2 +1\.200e-06 ")
    ),
    "30_gearbox_output_speed": Right("identify", 0, ("ke / kt is 20", r"gear_ratio = \{ value = 20,")),
    "31_limit_changed_at_run_time": Right("generate", 2, (r"ranges = \{ kp = \[.*u_max = \[",)),
}
OTHERS = {"29_mpc_nan_status", "32_diagnose_no_mismatch", "40_shift_beyond_the_word", "41_project_runs_a_command"}


def copied(name: str, folder: Path) -> Path:
    return Path(shutil.copytree(CASES / name, folder / "case"))


def ended(words: list[str], capsys: pytest.CaptureFixture[str]) -> tuple[int, str]:
    """Return the exit status and all that was said."""
    status = main(words)
    said = capsys.readouterr()
    return status, said.out + said.err


def test_every_case_has_its_right_outcome() -> None:
    assert {path.name for path in CASES.iterdir() if path.is_dir()} == {*RIGHT, *OTHERS, CASE_42}


@pytest.mark.parametrize("name", RIGHT)
def test_a_case_comes_out_right(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    right, here = RIGHT[name], copied(name, tmp_path)
    status, said = ended([right.command, str(here / "project.toml"), "--out", str(here / "out")], capsys)
    assert status == right.status, said
    for pattern in right.says:
        assert re.search(pattern, said), said
    for parameter, value in right.values.items():
        found = re.search(rf"^  {parameter} +(\S+)", said, re.MULTILINE)
        assert found and float(found[1]) == pytest.approx(value, rel=right.near), said
    assert (here / "out").exists() == (status == 0)


@pytest.mark.parametrize("number", ["1", "3", "5", "7", "9", "10"])
def test_extreme_numbers_end_with_a_sentence(number: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    here = copied(f"{CASE_42}/{number}", tmp_path)
    paths = {"p.toml": str(here / "p.toml"), "out": str(here / "out")}
    status, said = ended([paths.get(word, word) for word in json.loads((here / "ARGV").read_text())], capsys)
    assert status == 2, said
    assert "internal error" not in said and not (here / "out").exists()


def test_a_project_runs_no_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    here = copied("41_project_runs_a_command", tmp_path)
    monkeypatch.chdir(here)
    status, said = ended(["verify", "p.toml", "--out", "out", "--steps", "50"], capsys)
    assert status == 2 and "evil.toml" in said
    assert not [path for path in tmp_path.rglob("*") if path.name == "RAN"]


@SLOW
@pytest.mark.parametrize("name", ["min_plain.toml", "min_tuned.toml"])
def test_no_shift_is_as_wide_as_its_word(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A law that no word can hold is refused; one that is made agrees, under the sanitizers as well."""
    here = copied("40_shift_beyond_the_word", tmp_path)
    words = ["verify", str(here / name), "--target", "host", "--steps", "2000", "--out", str(here / "out")]
    status, said = ended(words, capsys)
    assert status == 2 or (status == 0 and "0 differences: agrees" in said and "nothing found" in said), said
    text = "".join(path.read_text() for path in here.rglob("*.c"))
    assert not [width for width in re.findall(r"fl_(?:asr|shl|shr)_i32\([^;]*, (\d+)U?\)", text) if int(width) > 31]


@SLOW
def test_a_reading_that_is_no_number_is_told_by_the_status(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    here = copied("29_mpc_nan_status", tmp_path)
    status, said = ended(["generate", str(here / "project.toml"), "--out", str(here / "out")], capsys)
    assert status == 0, said
    assert any("LOOP_NOT_A_NUMBER" in path.read_text() for path in here.rglob("loop.h"))


@SLOW
def test_a_wrong_start_hides_no_mismatch(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    here = copied("32_diagnose_no_mismatch", tmp_path)
    status, said = ended(["diagnose", str(here / "project.toml"), "--out", str(here / "out")], capsys)
    assert status != 70 and not (status == 0 and "no mismatch" in said), said

"""`firmloop init` on logs of one heater as programs and people write them: the plant comes out right."""

from __future__ import annotations

import tomllib
from collections.abc import Callable
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from firmloop.cli import main

STEP, LAG, GAIN, REST = 2.0, 150.0, 0.5, 20.0  # s, s, K/%, degC
TIME = STEP * np.arange(1500)
POWER = np.repeat([0.0, 60.0, 100.0, 40.0, 0.0], 300)  # %


def warmed(power: np.ndarray) -> np.ndarray:
    """Return how much warmer than at rest a lag behind a power is, with a little noise."""
    stays, out = np.exp(-STEP / LAG), np.zeros(len(power))
    for k in range(1, len(power)):
        out[k] = stays * out[k - 1] + (1.0 - stays) * GAIN * power[k - 1]
    return out + np.random.default_rng(3).normal(0.0, 0.02, len(power))


HEAT = REST + warmed(POWER)


def rows(header: str, form: Callable[..., str], *columns: np.ndarray) -> str:
    return "\n".join([header, *(form(*row) for row in zip(*columns, strict=True)), ""])


def heater(header: str, form: Callable[..., str]) -> str:
    return rows(header, form, TIME, POWER, HEAT)


SWITCHED = np.where(POWER > 50.0, 1.0, 0.0)
HEAT_SWITCHED = REST + warmed(80.0 * SWITCHED)


def states(on: str, off: str) -> str:
    def row(t: float, u: float, y: float) -> str:
        return f"{t:.0f},{on if u else off},{y:.3f}"

    return rows("t_s,heater,temp_C", row, TIME, SWITCHED, HEAT_SWITCHED)


def as_date(t: float) -> str:
    return f"{datetime(2024, 3, 1, 9) + timedelta(seconds=t):%Y-%m-%dT%H:%M:%S.%f}Z"


def home_automation() -> str:
    """Return a line for each reading, and for each change of a switch alone, between two readings."""
    changed = np.flatnonzero(np.diff(SWITCHED, prepend=-1.0))
    said = [(TIME[k] - 0.7 * (k > 0), f"switch.heater,{'on' if SWITCHED[k] else 'off'}") for k in changed]
    said += [(t, f"sensor.temperature,{y:.3f}") for t, y in zip(TIME + 0.3, HEAT_SWITCHED, strict=True)]
    said.append((TIME[700] + 0.5, "sensor.temperature,unavailable"))
    return "\n".join(["entity_id,state,last_changed", *(f"{what},{as_date(t)}" for t, what in said), ""])


def two_rates() -> str:
    """Return a table of two columns whose readings are 0.3 s apart, each with an empty cell beside it."""
    lines = (f"{t:.1f},{u:.0f},\n{t + 0.3:.1f},,{y:.3f}" for t, u, y in zip(TIME, POWER, HEAT, strict=True))
    return "\n".join(["time_s,heater_percent,temperature_C", *lines, ""])


def topics() -> str:
    lines = (
        f"{1.7e12 + 1e3 * t:.0f};home/heater/pwm;{u:.0f}\n{1.7e12 + 1e3 * t + 300:.0f};home/temp;{y:.3f}"
        for t, u, y in zip(TIME, POWER, HEAT, strict=True)
    )
    return "\n".join(["timestamp;topic;payload", *lines, ""])


def newest_first() -> str:
    lines = [f"{as_date(t)},{u:.0f},{y:.3f}" for t, u, y in zip(TIME, POWER, HEAT, strict=True)]
    return "\n".join(["time,heater,temp_C", *lines[::-1], ""])


LOGS: dict[str, tuple[str, float]] = {  # and what the gain is times that of % and K
    "days of a spreadsheet, called a date": (
        heater("Date,Heater %,Temp C", lambda t, u, y: f"{45352.375 + t / 86400:.6f},{u:.0f},{y:.3f}"),
        1.0,
    ),
    "days of a spreadsheet, called a time": (
        heater("Time,Heater %,Temp C", lambda t, u, y: f"{45352.375 + t / 86400:.9f},{u:.0f},{y:.3f}"),
        1.0,
    ),
    "days of MATLAB": (
        heater("datenum,u_pct,T_C", lambda t, u, y: f"{739312.5 + t / 86400:.9f},{u:.0f},{y:.3f}"),
        1.0,
    ),
    "Fahrenheit as a letter": (
        heater("minutes,heater,Temp F", lambda t, u, y: f"{t / 60:.4f},{u:.0f},{1.8 * y + 32:.2f}"),
        1.0,
    ),
    "a time that is called by its unit alone": (
        heater("s,heater,temp_C", lambda t, u, y: f"{t:.0f},{u:.0f},{y:.3f}"),
        1.0,
    ),
    "a signal of 4 to 20 mA that rests at 4": (
        heater("t_s,valve_mA,temp_C", lambda t, u, y: f"{t},{4 + 0.16 * u:.3f},{y - REST:.3f}"),
        6250.0,
    ),
    "a switch that is ON or OFF": (states("ON", "OFF"), 80.0),
    "a switch that is True or False": (states("True", "False"), 80.0),
    "a switch in German": (states("Ein", "Aus"), 80.0),
    "a line for each value, and for each change of a switch": (home_automation(), 80.0),
    "a line for each value, with a topic": (topics(), 1.0),
    "readings one after the other, each with empty cells": (two_rates(), 1.0),
    "a signal in each line": (
        "\n".join(
            ",".join([name, *(f"{value:.7g}" for value in column)])
            for name, column in (("time_s", TIME), ("heater_pct", POWER), ("temp_C", HEAT))
        ),
        1.0,
    ),
    "the newest row first": (newest_first(), 1.0),
}


@pytest.mark.parametrize("name", LOGS)
def test_a_log_gives_the_plant_its_right_values(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    content, scale = LOGS[name]
    monkeypatch.chdir(tmp_path)
    Path("log.csv").write_text(content, encoding="utf-8")
    assert main(["init", "log.csv"]) == 0, capsys.readouterr().err
    assert main(["identify", "log.toml", "--out", "out"]) == 0, capsys.readouterr().err
    plant = tomllib.loads(Path("out/project.toml").read_text())["plant"]
    values = {key: each["value"] for key, each in plant["parameters"].items()}
    assert plant["kind"] == "first_order" and plant["outputs"] == ["temperature_C"]
    assert values["gain"] == pytest.approx(GAIN * scale, rel=0.01)
    late = 1.0 if "change of a switch" in name else 0.0  # of the readings behind the switch, as it is written there
    assert values["delay_s"] == pytest.approx(late, abs=0.1 * STEP)
    assert values["time_constant_s"] == pytest.approx(LAG, rel=0.01)
    assert values["output_at_rest"] == pytest.approx(0.0 if "4 to 20" in name else REST, abs=0.1)


TURNS = np.repeat([0.0, 0.6, -0.8, 1.0, -0.4, 0.2, -1.0, 0.0], 60)  # of the supply
SPEED = np.zeros(len(TURNS))
for _k in range(1, len(TURNS)):
    SPEED[_k] = SPEED[_k - 1] + 0.25 * (90.0 * TURNS[_k - 1] - SPEED[_k - 1])
MS = 10.0 * np.arange(len(TURNS))


def init_says(content: str, capsys: pytest.CaptureFixture[str], *more: str) -> tuple[int, str]:
    Path("log.csv").write_text(content, encoding="utf-8")
    status = main(["init", "log.csv", *more])
    said = capsys.readouterr()
    return status, said.out + said.err


@pytest.mark.parametrize(
    ("ways", "where"),
    [(("0", "1"), "where dir is 0"), (("rev", "fwd"), "(1 for fwd, -1 for rev)"), (("CCW", "CW"), "where dir is -1")],
)
def test_a_drive_whose_direction_is_in_another_column_is_told(
    ways: tuple[str, str],
    where: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)

    def row(t: float, u: float, y: float) -> str:
        return f"{t:.0f},{abs(255 * u):.0f},{ways[int(u >= 0)]},{y:.2f}"

    status, said = init_says(rows("ms,pwm,dir,speed_rad_s", row, MS, TURNS, SPEED), capsys)
    assert status == 2 and "pwm has no sign, and its direction stands in dir" in said and where in said
    signed = rows("ms,pwm,speed_rad_s", lambda t, u, y: f"{t:.0f},{255 * u:.0f},{y:.2f}", MS, TURNS, SPEED)
    assert init_says(signed, capsys)[0] == 0


def test_the_two_inputs_of_a_bridge_are_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)

    def row(t: float, u: float, y: float) -> str:
        return f"{t:.0f},{max(255 * u, 0):.0f},{max(-255 * u, 0):.0f},{y:.2f}"

    status, said = init_says(rows("ms,in1,in2,speed_rad_s", row, MS, TURNS, SPEED), capsys)
    assert status == 2 and "write in1 - in2 in one column" in said


def test_a_flag_beside_a_drive_that_goes_one_way_is_no_direction(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    flag = (POWER > 70.0).astype(float)
    content = rows(
        "t_s,heater,alarm,temp_C", lambda *row: "{:g},{:g},{:g},{:.3f}".format(*row), TIME, POWER, flag, HEAT
    )
    assert init_says(content, capsys)[0] == 0


def test_rows_in_no_order_are_to_be_sorted_and_given_no_period(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    mixed = np.random.default_rng(2).permutation(len(TIME))
    form = "{:.1f},{:.0f},{:.3f}".format
    status, said = init_says(rows("t_s,heater,temp_C", form, TIME[mixed], POWER[mixed], HEAT[mixed]), capsys)
    assert status == 2 and "sort the rows of the file by t_s" in said and "period" not in said
    status, said = init_says(rows("t_s,heater,temp_C", form, TIME[::-1], POWER[::-1], HEAT[::-1]), capsys)
    assert status == 2 and "turn the rows around" in said and "period" not in said


@pytest.mark.parametrize("bits", [10, 16])
def test_counts_that_wrap_at_the_end_of_a_word_go_on(
    bits: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    turned = np.concatenate([[0.0], np.cumsum(SPEED[:-1] * 0.01)])
    counts = (np.floor(turned * 2.0**bits / 18.0).astype(int) + 2 ** (bits - 1)) % 2**bits - 2 ** (bits - 1)
    form = "{:.0f},{:.0f},{:d}".format
    assert init_says(rows("ms,pwm,enc", form, MS, 255 * TURNS, counts), capsys)[0] == 0
    made = tomllib.loads(Path("log.toml").read_text())
    assert made["recordings"]["rename"]["enc"] == {"name": "position_rad", "wraps": 2.0**bits}
    assert made["plant"]["kind"] == "rotary_stage"


@pytest.mark.parametrize(
    ("column", "cure"),
    [
        ("dt_ms", "give --period 0.002;"),
        ("dt", "write its running sum into a column time_s;"),
    ],
)
def test_a_column_of_steps_of_time_is_told_with_its_cure(
    column: str, cure: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    apart = np.full(len(TIME), 2.0) if column == "dt_ms" else 2.0 + 0.1 * np.sin(np.arange(len(TIME)))
    status, said = init_says(rows(f"{column},heater,temp_C", "{:.4f},{:.0f},{:.3f}".format, apart, POWER, HEAT), capsys)
    assert status == 2 and f"{column} seems to be the time from row to row: {cure}" in said


WANTED: dict[str, tuple[str, tuple[np.ndarray, ...], tuple[str, str], float]] = {  # header, columns, ends, gain
    "watts by a small letter": ("t_s,heater_w,temp_c", (TIME, POWER, HEAT), ("heater_w", "temperature_C"), GAIN),
    "what a battery is loaded with": (
        "t_s,load_A,voltage_V",
        (TIME, POWER, 12.6 - 0.08 * (HEAT - REST)),
        ("current_A", "voltage_V"),
        -0.08 * GAIN,
    ),
    "a relay beside another reading": (
        "t_s,relay,temp_C,humidity",
        (TIME, SWITCHED, HEAT_SWITCHED, 45.0 + 0.05 * np.random.default_rng(8).normal(size=len(TIME))),
        ("relay", "temperature_C"),
        80.0 * GAIN,
    ),
}


@pytest.mark.parametrize("name", WANTED)
def test_what_drives_is_told_from_what_answers(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    header, columns, ends, gain = WANTED[name]
    form = ",".join(["{:.5g}"] * len(columns)).format
    status, said = init_says(rows(header, form, *columns), capsys)
    assert status == 0, said
    plant = tomllib.loads(Path("log.toml").read_text())["plant"]
    assert (plant["input"], *plant["outputs"]) == ends
    assert plant["parameters"]["gain"]["value"] == pytest.approx(gain, rel=0.02)


def test_the_range_of_the_output_holds_what_was_recorded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    content = rows("t_s,heater,temp_C", "{:.0f},{:.3f},{:.3f}".format, TIME, 1.00314 * POWER, HEAT)
    assert init_says(content, capsys)[0] == 0
    made = tomllib.loads(Path("log.toml").read_text())["signals"]["output"]
    assert made["low"] == 0.0 and 100.314 <= made["high"] <= 101.0

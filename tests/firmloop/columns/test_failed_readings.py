"""Readings that failed among sound ones: a sensor's first value, one number again and again, a value that stays."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from bench.host.identify_faults import changed, heater, motor, swing
from firmloop.cli import main
from tests.firmloop.columns.test_identify_says import written

Array = np.ndarray


def put(rows: object, value: float) -> Callable[[Array], Array]:
    """Return what writes a value into rows."""

    def failed(values: Array) -> Array:
        made = values.copy()
        made[rows] = value
        return made

    return failed


def kept(first: int, end: int) -> Callable[[Array], Array]:
    """Return what repeats a row up to another."""
    return lambda values: put(slice(first, end), float(values[first]))(values)


ROWS = np.array([150, 333, 402, 611, 777])
SIXTEENTHS = 1.0 / 16.0
FAILED = {
    "one number, five times": (put(ROWS, -1.0), "reads -1 at", "no other is leapt to"),
    "one number in each fifty": (put(np.arange(230, 1200, 50), 9.0), "reads 9 at", "and 19 more such"),
    "zero for a while": (put(slice(700, 740), 0.0), "stands at 0 from", "had nothing to read"),
    "twenty rows": (kept(700, 720), "stands at", "(20 rows)"),
    "to the end": (kept(1000, 1200), "stands at", "repeated its last value; cut these rows out"),
}


@pytest.mark.parametrize("name", FAILED)
def test_readings_that_failed_are_told_though_others_come_near(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    fail, *words = FAILED[name]
    table, time, columns = changed(swing(np.random.default_rng(5)), level=fail)
    given = {key: value for key, value in table["parameters"].items() if key == "delay_s"}
    project = written(tmp_path / "log", ({**table, "parameters": given}, time, columns)) / "project.toml"
    assert main(["identify", str(project), "--out", str(tmp_path / "out")]) == 0
    said = capsys.readouterr().out
    assert all(word in said for word in words)


@pytest.mark.parametrize("verb", ["identify", "diagnose"])
def test_a_reading_alone_among_others_of_its_size_is_told(
    verb: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    made = changed(swing(np.random.default_rng(5)), level=lambda v: put([np.argmin(v)], 0.0)(v))
    project = written(tmp_path / "log", made) / "project.toml"
    assert main([verb, str(project), "--out", str(tmp_path / "out")]) == (0 if verb == "identify" else 2)
    said = capsys.readouterr()
    assert "a reading that failed, for no other is leapt to" in said.out + said.err


@pytest.mark.parametrize("rows", [[0], [0, 377, 811]])
def test_the_value_that_a_thermometer_begins_with_is_no_temperature(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], rows: list[int]
) -> None:
    """A DS18B20 reads 85 degC before it has measured."""
    made = changed(
        heater(np.random.default_rng(1)),
        temperature_C=lambda v: put(rows, 85.0)(np.round((21.0 + v) / SIXTEENTHS) * SIXTEENTHS),
        heater_percent=lambda v: np.where(np.arange(len(v)) < 20, 0.0, v),
    )
    project = written(tmp_path / "log", made, "output_at_rest = 20.0") / "project.toml"
    assert main(["identify", str(project), "--out", str(tmp_path / "out")]) == 0
    assert "temperature_C of log.csv reads 85 at 0 s, before 2" in capsys.readouterr().out


@pytest.mark.parametrize(
    "sound", [lambda v: v, lambda v: np.round(v, 1), lambda v: np.round(v), lambda v: np.clip(v, -4.0, 4.0), np.abs]
)
def test_coarse_and_noisy_readings_are_none_that_failed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], sound: Callable[[Array], Array]
) -> None:
    project = written(tmp_path / "log", changed(swing(np.random.default_rng(5)), level=sound)) / "project.toml"
    assert main(["identify", str(project), "--out", str(tmp_path / "out")]) == 0
    said = capsys.readouterr().out
    assert "that failed" not in said and "stands at" not in said


@pytest.mark.parametrize("first", [None, 500, 900, 1300])
def test_a_coarse_reading_that_freezes_among_its_own_repeats_is_told(
    first: int | None, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Steps of 5 rad/s stand still for hundreds of rows by themselves; a leap makes up for what was missed."""

    def read(speed: Array) -> Array:
        coarse = np.round(speed / 5.0) * 5.0
        if first is None:
            return coarse
        moving = first + int(np.argmax(np.abs(speed[first:-300] - speed[first + 300 :]) > 60.0))
        return kept(moving, moving + 300)(coarse)

    folder = written(tmp_path / "log", changed(motor(np.random.default_rng(3)), speed_rad_s=read))
    assert main(["identify", str(folder / "project.toml"), "--out", str(folder / "out")]) == 0
    assert ("as far as the plant has moved meanwhile" in capsys.readouterr().out) == (first is not None)

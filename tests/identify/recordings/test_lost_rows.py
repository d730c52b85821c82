"""Rows that are missing in a recording are told, with the key that gives their time back; sound ones stay silent."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import numpy as np
import pytest

from firmloop.cli import main
from firmloop.identify.error import IdentifyError
from firmloop.identify.recordings.columns import Column
from firmloop.identify.recordings.recording import Recording, read_recording

COUNT, PERIOD = 400, 0.01  # rows, s
LAG = 0.8  # s
PROJECT = """\
schema = 1
name = "oven"
[recordings]
train = ["log.csv"]
{rename}
[plant]
kind = "first_order"
input = "heat"
outputs = ["temperature_C"]
[plant.parameters]
gain = {{ value = 1.0, free = true }}
time_constant_s = {{ value = 1.0, free = true }}
"""


def rows() -> dict[str, np.ndarray]:
    heat = np.where(np.arange(COUNT) // 90 % 2 == 0, 1.0, -1.0)
    heat[:10] = 0.0
    warm, share = np.zeros(COUNT), np.exp(-PERIOD / LAG)
    for k in range(COUNT - 1):
        warm[k + 1] = share * warm[k] + (1 - share) * 20 * heat[k]
    noise = np.random.default_rng(1).normal(scale=0.05, size=COUNT)
    return {"time_s": np.arange(COUNT) * PERIOD, "heat": heat, "temperature_C": warm + noise}


def written(folder: Path, columns: dict[str, np.ndarray]) -> Path:
    lines = [",".join(columns), *(",".join(f"{x:.10g}" for x in row) for row in zip(*columns.values(), strict=True))]
    path = folder / "log.csv"
    path.write_text("\n".join(lines) + "\n")
    return path


def without(columns: dict[str, np.ndarray], *spans: tuple[int, int]) -> dict[str, np.ndarray]:
    kept = np.ones(COUNT, bool)
    for first, end in spans:
        kept[first:end] = False
    return {name: column[kept] for name, column in columns.items()}


def advised(said: str) -> dict[str, Column]:
    """Return the lines of [recordings.rename] that a message gives."""
    lines = [line.strip() for line in said.splitlines() if re.match(r"\s*\w+ = ", line)]
    table = tomllib.loads("\n".join(lines))
    return {key: Column(**value) if isinstance(value, dict) else Column(value) for key, value in table.items()}


def told(recording: Recording) -> str:
    return " ".join(recording.notes)


@pytest.mark.parametrize("jitter", [0.0, 0.1])
def test_a_sound_recording_and_one_of_uneven_rows_are_read_in_silence(jitter: float, tmp_path: Path) -> None:
    columns = rows()
    columns["time_s"] = columns["time_s"] + jitter * PERIOD * np.random.default_rng(2).uniform(-1, 1, COUNT)
    assert read_recording(written(tmp_path, columns), {}).notes == ()
    uneven = columns | {"time_s": np.cumsum(np.random.default_rng(3).uniform(0.001, 0.1, COUNT))}
    assert read_recording(written(tmp_path, uneven), {}).notes == ()


def test_a_clock_that_jitters_by_up_to_a_row_leaps_over_none(tmp_path: Path) -> None:
    late = 1.0 + np.where(np.arange(COUNT) % 25 == 0, np.random.default_rng(4).uniform(0.3, 1.2, COUNT), 0.0)
    columns = rows() | {"time_s": np.cumsum(late) * PERIOD}
    assert read_recording(written(tmp_path, columns), {}).notes == ()


def test_rows_that_the_clock_leaps_over_are_counted(tmp_path: Path) -> None:
    said = told(read_recording(written(tmp_path, without(rows(), (100, 137), (300, 301))), {}))
    assert "37 rows are missing after 0.99 s (38 in 2 such places)" in said
    assert "goes on by 0.38 s there, where rows are 0.01 s apart" in said and "list both parts" in said


@pytest.mark.parametrize(("word", "each"), [(0, 1), (256, 1), (65536, 400)])
def test_rows_that_only_a_counter_misses_get_their_time_back_from_it(word: int, each: int, tmp_path: Path) -> None:
    counter = np.arange(COUNT, dtype=float) * each + 7
    columns = without(rows() | {"seq": counter % word if word else counter}, (100, 137), (300, 360))
    kept = columns["time_s"].copy()
    columns["time_s"] = np.arange(len(kept)) * PERIOD
    path = written(tmp_path, columns)
    said = told(read_recording(path, {}))
    assert "37 rows are missing after 0.99 s (97 in 2 such places): seq counts them" in said
    mended = read_recording(path, advised(said))
    np.testing.assert_allclose(mended.time - mended.time[0], kept, atol=1e-9)


def test_an_encoder_that_turns_evenly_counts_no_rows(tmp_path: Path) -> None:
    turned = np.floor(np.arange(COUNT) * 3.3)
    assert read_recording(written(tmp_path, rows() | {"encoder": turned}), {}).notes == ()


@pytest.mark.parametrize(("hertz", "ticks"), [(32768.0, 328), (32768.0, 512), (84e6 / 1024, 800)])
def test_a_short_counter_in_seconds_that_begins_at_zero_is_told_from_several_recordings(
    hertz: float, ticks: int, tmp_path: Path
) -> None:
    columns = rows() | {"time_s": np.arange(COUNT) * ticks % 65536 / hertz}
    with pytest.raises(IdentifyError, match=r"a counter that wraps: .* is 2\^(16|24) ticks of") as caught:
        read_recording(written(tmp_path, columns), {})
    mended = read_recording(tmp_path / "log.csv", advised(str(caught.value)))
    np.testing.assert_allclose(mended.time, np.arange(COUNT) * ticks / hertz, atol=1e-6)
    apart = {name: np.tile(column[:128], 3) for name, column in rows().items()} | {
        "time_s": np.tile(np.arange(128) * 512 / 32768.0, 3)
    }
    with pytest.raises(IdentifyError, match="holds 3 recordings"):
        read_recording(written(tmp_path, apart), {})


def test_identify_and_its_cure_tell_the_lag_of_a_recording_with_rows_missing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    columns = without(rows() | {"n": np.arange(COUNT, dtype=float)}, (60, 90), (150, 180), (230, 270))
    columns["time_s"] = np.arange(len(columns["n"])) * PERIOD
    written(tmp_path, columns)
    project = tmp_path / "oven.toml"
    project.write_text(PROJECT.format(rename=""))
    assert main(["identify", str(project), "--out", str(tmp_path / "out")]) == 0
    said = capsys.readouterr().out
    assert said.count("30 rows are missing after 0.59 s (100 in 3 such places): n counts them") == 1
    project.write_text(PROJECT.format(rename='[recordings.rename]\nn = { name = "time_s", unit = "s", scale = 0.01 }\n'
                                      'time_s = "clock"'))  # fmt: skip
    assert main(["identify", str(project), "--out", str(tmp_path / "out")]) == 0
    found = tomllib.loads((tmp_path / "out" / "project.toml").read_text())["plant"]["parameters"]["time_constant_s"]
    assert found["value"] == pytest.approx(LAG, rel=0.02)


def test_a_quote_that_does_not_close_is_told_with_its_line(tmp_path: Path) -> None:
    path = written(tmp_path, rows())
    lines = path.read_text().splitlines()
    lines[122] = lines[122].replace(",", ',"', 1)
    path.write_text("\n".join(lines))
    with pytest.raises(IdentifyError, match=r"line 123, column heat: .*its quote does not close; delete that quote"):
        read_recording(path, {})

"""What differs from recording to recording is told with the names of the files and the line that mends it."""

from __future__ import annotations

import re

import numpy as np
import pytest

from bench.host.identify_faults import changed, heater, motor
from tests.firmloop.columns.test_identify_says import identified, logged, seeded, written


def beside(folder, made, name="other.csv", line=""):
    """Write a second recording beside the first, and list both."""
    _, time, columns = made
    logged(folder / name, time, columns)
    text = (folder / "project.toml").read_text()
    listed = text.replace('train = ["log.csv"]', f'train = ["log.csv", "{name}"]\n{line}', 1)
    (folder / "project.toml").write_text(listed)
    return folder


def warm(seed: int, level: float):
    return changed(heater(seeded(seed)), temperature_C=lambda v: v + level)


def test_a_level_of_each_recording_is_told_and_its_lines_give_the_plant_back(tmp_path, capsys):
    says, _ = identified(beside(written(tmp_path / "plain", warm(1, 19.0)), warm(2, 27.0)), capsys)
    assert len(says) == 1 and "rests at another level in each recording, degC" in says[0], says
    assert re.search(r": (18\.9|19)\S* in log\.csv, (26\.9|27)\S* in other\.csv", says[0]), says
    level = says[0].partition("write ")[2].partition(" in [plant")[0]
    listed = says[0].partition("] and ")[2].partition(" in [")[0]
    folder = beside(written(tmp_path / "mended", warm(1, 19.0), level), warm(2, 27.0), line=listed)
    says, found = identified(folder, capsys)
    assert says == []
    assert found["gain"] == pytest.approx(0.62, rel=0.02)


def test_a_level_alone_does_not_hide_that_it_differs(tmp_path, capsys):
    level = "output_at_rest = { value = 20.0, free = true }"
    says, _ = identified(beside(written(tmp_path / "run", warm(1, 19.0), level), warm(2, 27.0)), capsys)
    assert "rests at another level in each recording" in says[0], says


def test_one_level_of_two_recordings_is_told_as_one(tmp_path, capsys):
    says, _ = identified(beside(written(tmp_path / "run", warm(1, 19.0)), warm(2, 19.0)), capsys)
    assert len(says) == 1 and re.match(r"temperature_C rests at (18.9|19)\S* degC and", says[0]), says


def test_a_reading_that_runs_backwards_in_one_recording_is_told_with_its_name(tmp_path, capsys):
    back = changed(motor(seeded(2)), speed_rad_s=np.negative)
    says, _ = identified(beside(written(tmp_path / "run", motor(seeded(1))), back), capsys)
    assert len(says) == 1 and says[0].startswith("speed_rad_s of other.csv runs against voltage_V"), says


def test_a_reading_without_a_sign_is_told_and_its_effect_gives_the_motor_back(tmp_path, capsys):
    made = changed(motor(seeded(4)), speed_rad_s=np.abs)
    says, _ = identified(written(tmp_path / "plain", made), capsys)
    assert len(says) == 1 and "speed_rad_s of log.csv is never negative" in says[0], says
    effect = '[[plant.effects]]\nname = "sensor_rectified"\noutput = "speed_rad_s"'
    says, found = identified(written(tmp_path / "mended", made, effects=effect), capsys)
    assert found["ke_V_s_rad"] == pytest.approx(0.037, rel=0.02) and not any("never negative" in one for one in says)


def test_a_ramp_and_a_step_are_no_single_frequency(tmp_path, capsys):
    """A step that begins with its recording is tapered away where frequencies are counted."""
    random, time = seeded(11), 0.01 * np.arange(900)
    given = {"gain": 3.0, "time_constant_s": 0.3, "delay_s": 0.0}
    table = {"kind": "first_order", "input": "valve_V", "outputs": ["level_V"], "parameters": given}
    made = []
    for drive in (0.2 * time, np.where(time > 0.015, 5.0, 0.0)):
        level = [0.0]
        for u in drive[:-1]:
            level.append(level[-1] + (1.0 - np.exp(-0.01 / 0.3)) * (3.0 * u - level[-1]))
        made.append({"valve_V": drive, "level_V": np.array(level) + 0.002 * random.normal(size=len(time))})
    folder = written(tmp_path / "run", (table, time, made[0]))
    beside(folder, (table, time, made[1]))
    says, found = identified(folder, capsys)
    assert not any("frequenc" in one for one in says), says
    assert found["time_constant_s"] == pytest.approx(0.3, rel=0.02)


def test_a_reading_in_another_unit_in_one_recording_is_told_and_its_cure_gives_the_motor_back(tmp_path, capsys):
    turned = changed(motor(seeded(2)), speed_rad_s=lambda v: v * 30.0 / np.pi)
    folder = beside(written(tmp_path / "run", motor(seeded(1))), turned)
    says, _ = identified(folder, capsys)
    assert re.match(r"speed_rad_s is 9\.\d+ times as large in other\.csv as in log\.csv", says[0]), says
    assert "it looks in revolutions per minute" in says[0] and not any("encoder" in one for one in says)
    other = folder / "other.csv"
    other.write_text(other.read_text().replace("speed_rad_s", "n", 1))
    text = (folder / "project.toml").read_text()
    line = '[recordings.rename]\nn = { name = "speed_rad_s", unit = "rpm" }\n[plant]\n'
    (folder / "project.toml").write_text(text.replace("[plant]\n", line, 1))
    says, found = identified(folder, capsys)
    assert says == []
    assert found["ke_V_s_rad"] == pytest.approx(
        identified(written(tmp_path / "one", motor(seeded(1))), capsys)[1]["ke_V_s_rad"], rel=0.01
    )


def test_an_input_in_another_unit_in_one_recording_is_told_as_one_that_may_be(tmp_path, capsys):
    pushed = changed(motor(seeded(2)), voltage_V=lambda v: v * 1000.0)
    says, _ = identified(beside(written(tmp_path / "run", motor(seeded(1))), pushed), capsys)
    assert all("in other.csv as in log.csv" in one for one in says[:2]), says
    assert all("if it is what drives the plant that differs, do so with its column" in one for one in says[:2])

"""A start value far off accuses no clock and no kept value, and does not hold the fit where it began."""

from __future__ import annotations

import tomllib

import numpy as np
import pytest

from bench.host.identify_faults import heater, motor, steps
from bench.host.identify_faults import held as linear
from firmloop.cli import main
from tests.firmloop.columns.test_identify_says import seeded, written


def circuit(frequency: float):
    """An RLC circuit of 60 rad/s, with the frequency that the project begins at."""
    random, step = seeded(1), 1e-3
    drive = steps(random, 3000, (-5.0, 0.0, 3.0, 5.0, 8.0), 400)
    shown = linear([[0.0, 1.0], [-3600.0, -36.0]], [0.0, 3600.0], [[1.0, 0.0]], drive, step)[:, 0]
    values = {"gain": 1.0, "natural_frequency_rad_s": frequency, "damping_ratio": 0.5}
    table = {
        "kind": "second_order",
        "input": "voltage_V",
        "outputs": ["capacitor_V"],
        "parameters": {name: {"value": value, "free": True} for name, value in values.items()}
        | {"delay_s": {"value": 0.0, "free": False}},
    }
    columns = {"voltage_V": drive, "capacitor_V": shown + random.normal(0.0, 0.01, len(drive))}
    return table, np.arange(len(drive)) * step, columns


@pytest.mark.parametrize(("frequency", "told"), [(0.3, True), (2.0, True), (2000.0, False), (60_000.0, False)])
def test_a_frequency_far_off_is_found_and_is_said_to_be_a_guess(tmp_path, capsys, frequency: float, told: bool) -> None:
    folder = written(tmp_path / "made", circuit(frequency))
    assert main(["identify", str(folder / "project.toml"), "--out", str(folder / "out")]) == 0
    said = capsys.readouterr().out
    assert ("looks like" in said) == told
    assert ("was a guess far off" in said) == told and "denies a value" not in said
    fitted = tomllib.loads((folder / "out" / "project.toml").read_text())["plant"]["parameters"]
    assert fitted["natural_frequency_rad_s"]["value"] == pytest.approx(60.0, rel=1e-3)


def test_a_kept_value_that_the_fit_comes_back_to_is_not_denied(tmp_path, capsys) -> None:
    """Degrees Fahrenheit: the level at rest is what is missing; a delay of 0 was to take the place of 0."""
    table, time, columns = heater(seeded(4))
    table = {**table, "parameters": {**table["parameters"], "delay_s": {"value": 0.0, "free": False}}}
    (name,) = table["outputs"]
    folder = written(tmp_path / "made", (table, time, {**columns, name: 1.8 * columns[name] + 50.0}))
    assert main(["identify", str(folder / "project.toml"), "--out", str(folder / "out")]) == 0
    said = capsys.readouterr().out
    assert "output_at_rest" in said and "denies a value" not in said


@pytest.mark.parametrize(("frequency", "damping"), [(450.0, 0.00166), (1500.0, 0.5), (0.5, 1.5)])
def test_a_swing_is_found_where_frequency_and_damping_are_both_far_off(
    tmp_path, capsys, frequency: float, damping: float
) -> None:
    """One of 643 rad/s, a turn more between two rows than the one there was, met the readings to 2 %."""
    random, step = seeded(2), 0.01
    drive = np.repeat(random.uniform(-5.0, 5.0, 30), 100)
    shown = linear([[0.0, 1.0], [-225.0, -1.5]], [0.0, 9000.0], [[1.0, 0.0]], drive, step)[:, 0]
    table, _, _ = circuit(frequency)
    table["parameters"]["damping_ratio"]["value"] = damping
    columns = {"voltage_V": drive, "capacitor_V": shown + random.normal(0.0, 1.6, len(drive))}
    folder = written(tmp_path / "made", (table, np.arange(len(drive)) * step, columns))
    assert main(["identify", str(folder / "project.toml"), "--out", str(folder / "out")]) == 0
    fitted = tomllib.loads((folder / "out" / "project.toml").read_text())["plant"]["parameters"]
    assert fitted["natural_frequency_rad_s"]["value"] == pytest.approx(15.0, rel=2e-3)
    assert fitted["damping_ratio"]["value"] == pytest.approx(0.05, rel=2e-2)


@pytest.mark.parametrize(
    ("times", "told"),
    [
        (1.0, ""),
        (1e3, "looks like milliseconds: L_H / R_ohm"),
        (1e-3, "looks like thousands of seconds: J R / (kt ke)"),
    ],
)
def test_a_clock_that_the_guesses_agree_with_is_told_by_what_no_motor_has(
    tmp_path, capsys, times: float, told: str
) -> None:
    table, time, columns = motor(seeded(3))
    for name in ("L_H", "J_kg_m2"):
        table["parameters"][name] = {"value": times * table["parameters"][name]["value"], "free": True}
    folder = written(tmp_path / "made", (table, times * time, columns))
    assert main(["identify", str(folder / "project.toml"), "--out", str(folder / "out")]) == 0
    said = capsys.readouterr().out
    assert told in said and ("looks like" in said) == bool(told), said

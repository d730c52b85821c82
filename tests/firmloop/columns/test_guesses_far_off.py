"""A start value far off accuses no clock and no kept value, and does not hold the fit where it began."""

from __future__ import annotations

import tomllib

import numpy as np
import pytest

from bench.host.identify_faults import heater, steps
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

"""Readings in steps are simulated in steps only where noise does not blur them."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest

from bench.diagnose.blind_cases import draw_case
from tests.diagnose.cases import diagnosis, laid, said_of, shortened, simulated, without_tests
from tests.first_order_bench import answered, leave

GIVEN = """gain = { value = 1.9, free = true }
time_constant_s = { value = 1.6, free = true }
delay_s = { value = 0.0, free = false }
"""


@pytest.mark.parametrize(("noise", "stepped"), [(0.33, False), (0.05, True)])
def test_a_sensor_in_steps_is_named_and_makes_no_simulation_worse(tmp_path: Path, noise: float, stepped: bool) -> None:
    random, time = np.random.default_rng(3), np.arange(1200) * 0.1
    drive = "voltage_V", np.repeat(random.uniform(-5.0, 5.0, 12), 100)
    shown = answered(time, drive, {"gain": 2.0, "time_constant_s": 1.5, "delay_s": 0.0})
    path = leave(tmp_path, time, drive, np.round(shown + noise * random.normal(size=len(time))), GIVEN)
    status, said = diagnosis(path, tmp_path / "out")
    assert status == 1 and [each["name"] for each in said["effects"]] == ["sensor_quantization"], said["says"]
    rms = said["simulation_rms"]["train"]["temperature_C"]
    assert rms["after"] < 1.001 * rms["refit"]
    written = tomllib.loads((tmp_path / "out" / "project.toml").read_text())["plant"]
    assert ("effects" in written) is stepped
    assert any("which its noise blurs" in each for each in said["notes"]) is not stepped


def test_what_wide_steps_round_off_is_noise_however_slowly_it_moves(tmp_path: Path) -> None:
    """A scale as wide as a third of the way: what it rounds off follows the motion, and no effect."""
    path = shortened(without_tests(laid(tmp_path, simulated(draw_case, 1170004, "pair"))), 1500)
    said = said_of(path)
    assert [each["name"] for each in said["effects"]] == ["sensor_quantization"], said["says"]
    resolution = said["effects"][0]["parameters"]["resolution_m"]["value"]
    assert said["noise"]["position_m"] >= 0.99 * resolution / np.sqrt(12.0)

"""What a fit was led to first, by an angle, by a start or beside another effect, is not where it has to end."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench.diagnose.blind_cases import draw_case
from tests.diagnose.cases import Motor, said_of, shortened, turned, written

Array = NDArray[np.float64]
COGS = (0.0236, 10.0, -0.47)  # N m, a turn, rad


def _cogging(folder: Path, drive: Array, noise: Array) -> dict[str, Any]:
    """Diagnose the noisy speed of a motor that cogs; return what diagnosis.json would hold."""
    size, count, phase = COGS
    motor, told = Motor(3.85, 0.0128, 0.0985, 4.24e-4, 1.36e-4), (0.0995, 4.1e-4, 1.3e-4)
    return said_of(turned(folder, motor, told, drive, lambda angle: size * np.sin(count * angle + phase), noise))


def test_a_wave_follows_the_simulated_angle_where_that_passes_the_same_crests(tmp_path: Path) -> None:
    """It had stayed with the integral of a noisy speed, by which the wave begins elsewhere."""
    rng, rows = np.random.default_rng(7), 2400
    drive = 12.0 * np.repeat(np.sin(2.4 * np.arange(14) + rng.uniform(0.0, 6.0)), rows // 13)[:rows]
    drive[:10] = 0.0
    said = _cogging(tmp_path, drive, 0.18 * rng.normal(size=rows))
    (effect,) = said["effects"]
    assert effect["name"] == "cogging_torque"
    for name, true in zip(("amplitude_N_m", "periods_per_rev", "phase_rad"), COGS, strict=True):
        low, high = effect["parameters"][name]["ci95"]
        assert low < true < high, effect["parameters"]


def test_rows_left_out_are_simulated_from_where_the_recording_began(tmp_path: Path) -> None:
    """Slowly over the crests: from rest the shaft falls into another notch, and all that explains it was unknown."""
    rng, rows = np.random.default_rng(2), 2000
    drive = np.repeat(rng.uniform(-7.0, 7.0, rows), rng.integers(20, 80, rows))[:rows]
    drive[:10] = 0.0
    said = _cogging(tmp_path, drive, 0.18 * rng.normal(size=rows))
    assert said["verdict"] == "explained"
    assert [each["name"] for each in said["effects"]] == ["cogging_torque"]


def test_a_limit_stands_where_what_was_found_first_has_nothing_left_to_do_beside_it(tmp_path: Path) -> None:
    """Two levels, both cut: a load and a scale are nearly that, but for the rows before the first level."""
    said = said_of(shortened(written(tmp_path, draw_case(1270007, "single")), 2500))
    assert [each["name"] for each in said["effects"]] == ["input_saturation"], said["says"]

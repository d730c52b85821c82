"""A drive or a duty that was logged without its direction is told, and a plant that is driven one way is not."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from bench.host.identify_faults import changed, motor, stage, swing
from tests.firmloop.columns.test_identify_says import identified, seeded, written


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize(
    ("make", "drive", "output"), [(motor, "voltage_V", "speed_rad_s"), (swing, "valve_V", "level")]
)
def test_a_drive_without_its_direction_is_told(make, drive, output, seed, tmp_path: Path, capsys):
    says, _ = identified(written(tmp_path / "log", changed(make(seeded(seed)), **{drive: np.abs})), capsys)
    assert len(says) == 1 and f"{drive} of log.csv is never negative, though {output} goes both ways" in says[0], says


@pytest.mark.parametrize(
    "make", [lambda r: motor(r, levels=(0.0, 2.0, 5.0, 9.0)), lambda r: stage(r, levels=(0.0, 3.0))]
)
def test_a_plant_that_is_driven_one_way_is_met_with_silence(make, tmp_path: Path, capsys):
    says, _ = identified(written(tmp_path / "log", make(seeded(1))), capsys)
    assert says == []

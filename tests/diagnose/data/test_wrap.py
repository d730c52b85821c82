"""A reading that wraps around is unrolled, slow or quick, and its range is read off to a fraction of its noise."""

from __future__ import annotations

from pathlib import Path

import pytest

from bench.diagnose.blind_cases import draw_case
from tests.diagnose.cases import drawn, said_of


# A quick current; a speed; quick up, slow down; a current whose nominal plant says too little of it.
@pytest.mark.parametrize("seed", [32069, 31020, 160018, 240075])
def test_wraps_are_read_off(tmp_path: Path, seed: int) -> None:
    (hidden,) = draw_case(seed).hidden
    assert hidden.name == "sensor_wrap"
    said = said_of(drawn(tmp_path, seed))
    assert said["verdict"] == "explained"
    (effect,) = said["effects"]
    assert effect["name"] == "sensor_wrap"
    (found,) = [each for name, each in effect["parameters"].items() if name.startswith("range_")]
    assert found["value"] == pytest.approx(hidden.told["range"], rel=2e-3)

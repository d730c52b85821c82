"""A reading that wraps around is unrolled, slow or quick, and its range is read off to a fraction of its noise."""

from __future__ import annotations

from pathlib import Path

import pytest

from bench.diagnose.blind_cases import draw_case
from tests.diagnose.cases import drawn, said_of


@pytest.mark.parametrize(
    "seed",
    [
        pytest.param(32069, id="a quick current", marks=pytest.mark.slow),
        pytest.param(31020, id="a speed"),
        pytest.param(160018, id="quick up and slow down", marks=pytest.mark.slow),
        pytest.param(240075, id="a current whose nominal plant says too little of it", marks=pytest.mark.slow),
    ],
)
def test_wraps_are_read_off(tmp_path: Path, seed: int) -> None:
    (hidden,) = draw_case(seed).hidden
    assert hidden.name == "sensor_wrap"
    said = said_of(drawn(tmp_path, seed))
    assert said["verdict"] == "explained"
    (effect,) = said["effects"]
    assert effect["name"] == "sensor_wrap"
    (found,) = [each for name, each in effect["parameters"].items() if name.startswith("range_")]
    assert found["value"] == pytest.approx(hidden.told["range"], rel=2e-3)

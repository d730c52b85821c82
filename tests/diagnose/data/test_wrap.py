"""A reading that wraps around is unrolled, slow or quick, and its range is read off to a fraction of its noise."""

from __future__ import annotations

from pathlib import Path

import pytest

from bench.diagnose.blind_cases import draw_case
from tests.diagnose.cases import SHORT, drawn, said_of, shortened

WHOLE = 5000  # rows of a case


@pytest.mark.parametrize(
    ("seed", "rows"),
    [
        pytest.param(32069, WHOLE, id="a quick current", marks=pytest.mark.slow),
        pytest.param(31020, SHORT, id="a speed"),
        pytest.param(160018, WHOLE, id="quick up and slow down", marks=pytest.mark.slow),
        pytest.param(240075, WHOLE, id="a current whose nominal plant says too little of it", marks=pytest.mark.slow),
    ],
)
def test_wraps_are_read_off(tmp_path: Path, seed: int, rows: int) -> None:
    (hidden,) = draw_case(seed).hidden
    assert hidden.name == "sensor_wrap"
    said = said_of(shortened(drawn(tmp_path, seed), rows))
    assert said["verdict"] == "explained"
    (effect,) = said["effects"]
    assert effect["name"] == "sensor_wrap"
    (found,) = [each for name, each in effect["parameters"].items() if name.startswith("range_")]
    assert found["value"] == pytest.approx(hidden.told["range"], rel=2e-3)

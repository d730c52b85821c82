"""A random force moves a position far: what it did by chance is no physics, though a wave of the place meets it."""

from __future__ import annotations

from pathlib import Path

import pytest

from bench.diagnose import nulls
from tests.diagnose.cases import said_of


@pytest.mark.parametrize(
    "seed",
    [
        997149,  # 4.0 N of cogging, 1.2 waves per m, had explained it
        pytest.param(997135, marks=pytest.mark.slow),  # gravity or cogging; the refit leaves five times the noise
        pytest.param(1000348, marks=pytest.mark.slow),  # a ripple of 1.1 %, by a chance of at most 1 in 2000
    ],
)
def test_a_stage_under_a_random_force_misses_nothing(seed: int, tmp_path: Path) -> None:
    nulls.write(seed, tmp_path)
    assert said_of(tmp_path / "project.toml")["verdict"] == "no_mismatch"

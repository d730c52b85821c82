"""A refit that leaves a motion altogether, as of a shaft too heavy to turn, has run away from what is missing."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.diagnose.cases import Motor, said_of, turned


@pytest.mark.parametrize(
    ("motor", "spring", "told"),  # N m/rad; ke, J and b, which are somewhat off
    [
        (Motor(1.82, 0.0019, 0.068, 4.17e-4, 6.4e-5), 0.27, (0.073, 4.1e-4, 6.9e-5)),
        pytest.param(
            Motor(4.83, 0.019, 0.0542, 1.03e-4, 2.83e-5),
            0.0778,
            (0.05305, 1.062e-4, 2.91e-5),
            marks=pytest.mark.slow,
        ),
    ],
)
def test_a_spring_that_the_shaft_swings_on_is_found_by_its_speed_alone(
    motor: Motor, spring: float, told: tuple[float, float, float], tmp_path: Path
) -> None:
    """It had been a coupling to a second body ten thousand times as heavy, or a hardening spring and a cogging."""
    rng, rows = np.random.default_rng(0), 1600
    drive = np.repeat(rng.uniform(-12.0, 12.0, rows // 100 + 1), 100)[:rows]
    drive[:10] = 0.0
    project = turned(tmp_path, motor, told, drive, lambda angle: spring * angle, 0.3 * rng.normal(size=rows))
    said = said_of(project)
    assert [each["name"] for each in said["effects"]] == ["return_spring"], said["says"]
    stiffness = said["effects"][0]["parameters"]["stiffness_N_m_rad"]["value"]
    assert stiffness == pytest.approx(spring, rel=0.02)

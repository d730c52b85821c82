"""A reading that wraps around is unrolled, slow or quick, and its range is read off to a fraction of its noise."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from bench.diagnose.blind_cases import draw_case
from firmloop.diagnose.data.unwrap import unwrapped
from firmloop.project.project import read_project
from firmloop.stages.data import read_data
from firmloop.stages.plant import plant_of
from tests.diagnose.cases import SHORT, drawn, lag_project, lagged, logged, said_of, shortened

WHOLE = 5000  # rows of a case
LAMP = lag_project("led_pct", "light_pct", 3.4, 0.02)


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


def test_a_reading_beyond_a_range_does_not_wrap_at_it(tmp_path: Path) -> None:
    """A lamp on a photoresistor, steps of which rise at once and fall slowly: they leap, by nearly the same each."""
    rng, rows = np.random.default_rng(0), 1400
    goals, light = np.repeat([0.3, 84.0, 0.7, 84.0, 42.0, 83.0, 0.7], rows // 7), np.empty(rows)
    now = goals[0]
    for k, goal in enumerate(goals):
        light[k] = now
        rises = goal > now
        now += (goal - now) * (0.85 if rises and now < 0.85 * goal else 0.02 if rises else 0.03)
    light += (0.1 + 0.6 * (light > 5.0)) * rng.normal(size=rows)
    drive = np.repeat([0.0, 25.0, 0.0, 25.0, 2.5, 25.0, 0.0], rows // 7)
    project = read_project(logged(tmp_path, LAMP, "time_s,led_pct,light_pct", 0.005 * np.arange(rows), drive, light))
    assert unwrapped(plant_of(project), read_data(project).train, ())[2] == ()


def test_a_current_that_rests_at_its_limits_does_not_wrap(tmp_path: Path) -> None:
    """A driver that limits its current turns it round from one row to the next, by the whole of what is seen of it."""
    rng, rows = np.random.default_rng(3), 1500
    drive = np.repeat(rng.choice([-9.6, 9.6], rows // 30), 30)
    limited = np.clip(lagged(drive / 10.0, 0.004), -0.27, 0.27) + 2e-3 * rng.normal(size=rows)
    head, project = "time_s,voltage_V,current_A", lag_project("voltage_V", "current_A", 0.1, 0.004)
    file = logged(tmp_path, project, head, 0.01 * np.arange(rows), drive, limited)
    assert unwrapped(plant_of(read_project(file)), read_data(read_project(file)).train, ())[2] == ()

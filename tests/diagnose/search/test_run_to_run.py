"""What differs from run to run is asked about where it brings simulations far nearer, and not by chance."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from firmloop.diagnose.search.harmless import Simulations
from firmloop.diagnose.search.run_to_run import differing
from firmloop.identify.plants.kinds import make_plant
from firmloop.identify.recordings.recording import make_recording
from firmloop.identify.simulation.simulate import simulate
from tests.diagnose.cases import lag_project, logged, said_of


def test_recordings_that_begin_at_other_noise_do_not_differ() -> None:
    plant = make_plant("rotary_stage", ("torque_N_m",), ["position_rad"], {"J_kg_m2": 0.01, "b_N_m_s_rad": 0.1})
    time, noise = np.arange(300) * 0.01, np.random.default_rng(6).normal(size=(2, 300)) * 1e-3
    noise[:, 0] = 2e-3, -2e-3
    driven = {"torque_N_m": 0.1 * (time < 1.0), "position_rad": 0.0 * time}
    bare = simulate(plant, make_recording(time, driven, "bare.csv", ""), None)[:, 0]
    logs = [make_recording(time, {**driven, "position_rad": bare + one}, f"{one[0]:g}.csv", "") for one in noise]
    assert differing(Simulations(plant, logs)) == ((), 1.0)


def test_a_duct_on_a_cool_and_on_a_warm_day_is_asked_for_its_level(tmp_path: Path) -> None:
    time, rng, project = np.arange(90) * 0.2, np.random.default_rng(3), tmp_path
    for name, ambient, heats in (("cool.csv", 24.0, (0, 5, 9)), ("warm.csv", 26.0, (2, 4, 1))):
        drive = np.repeat(np.array(heats, dtype=np.float64), 30)
        air = walls = 0.0
        reading = np.empty(90)
        for k in range(90):
            reading[k] = ambient + air + walls  # which nothing in the library is
            air += (1.0 - np.exp(-0.2 / 0.9)) * (2.0 * drive[k] - air)
            walls += (1.0 - np.exp(-0.2 / 30.0)) * (0.5 * drive[k] - walls)
        text = lag_project("heater_V", "temperature_C", 2.2, 1.0, ("cool.csv", "warm.csv"))
        text += "output_at_rest = { value = 25.0, free = true }\n"
        project = logged(
            tmp_path, text, "time_s,heater_V,temperature_C", time, drive, reading + rng.normal(size=90) * 4e-3
        )
        (tmp_path / "log.csv").rename(tmp_path / name)
    said = said_of(project)
    (asked,) = (line for line in said["says"] if "from run to run" in line)
    assert 'per_recording = ["output_at_rest"]' in asked

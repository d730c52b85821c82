"""Where a mismatch is said to be: in rows that can be weighed by those before them, not at the very first."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from firmloop.diagnose.discrepancy.disturbance import disturbances
from firmloop.diagnose.discrepancy.locate import worst_spans
from firmloop.diagnose.model.candidate import Candidate
from firmloop.diagnose.model.fit import fit
from firmloop.diagnose.model.hypothesis import first_point
from firmloop.diagnose.search.found import Search
from firmloop.identify.fitting.noise import Noise, white
from firmloop.identify.recordings.recording import make_recording
from tests.diagnose.cases import concealed, problem_of
from tests.sizes import stage


def test_the_first_rows_are_no_mismatch(tmp_path: Path) -> None:
    problem = problem_of(concealed(tmp_path, "", 1.0, False))
    fitted = fit(problem, problem.train, (), first_point(problem, problem.train), [white(1.0)] * 2, 0)
    time, draw = problem.train[0].time, np.random.default_rng(0)
    left = np.zeros((len(time), 2))
    left[:, 0] = 5.0  # noise with a memory may well begin there
    burst = (time > 1.0) & (time < 1.2)
    left[burst, 0] += draw.normal(0.0, 0.05, np.count_nonzero(burst))
    noises = (Noise(np.array([-1.0]), 0.01, 5.0), white(1.0))
    candidate = Candidate(replace(fitted, residuals=(left, *fitted.residuals[1:])), noises, 0.0)
    output, spans = worst_spans(Search(problem, candidate, candidate, (), (), ()), candidate.noises)
    assert output == problem.plant.outputs[0].name
    assert spans and all(0.9 < low < high < 1.3 for low, high in spans)


def test_a_motion_under_way_is_no_disturbance() -> None:
    plant = stage("position_m")
    time = 0.001 * np.arange(2000)
    columns = {"force_N": 4.0 * np.sign(np.sin(9.0 * time)), "position_m": np.zeros(len(time))}
    recording = make_recording(time, columns, "stage", "")
    grid = 5e-6
    coasting = np.round((0.003 - 0.02 * (1.0 - np.exp(-2.0 * time)) / 2.0) / grid) * grid
    (found,) = disturbances(plant, [recording], [coasting[:, None]], [grid / np.sqrt(12.0)]).values()
    assert found.unit == "N" and found.share is not None and found.share < 0.005

"""A screen tells what a term changes, and nothing else."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from firmloop.diagnose.model.fit import fit
from firmloop.diagnose.model.hypothesis import Point, entered, first_point
from firmloop.diagnose.search.screen import secants
from firmloop.identify.fitting.noise import white
from tests.diagnose.cases import concealed, problem_of


def test_beside_a_slow_clock_a_limit_that_is_never_met_changes_nothing(tmp_path: Path) -> None:
    """The last rows are read after the input has ended, so that no simulation is held against them."""
    problem = problem_of(concealed(tmp_path, "clock_skew", 1.0, False))
    skew, limit = problem.term("clock_skew"), problem.term("sensor_saturation")
    assert skew is not None and limit is not None
    begin = first_point(problem, problem.train)
    late = Point(entered(begin.values, skew, {skew.keys[0]: 0.002}), begin.starts)
    base = fit(problem, problem.train, (skew,), late, [white(1.0) for _ in problem.plant.outputs], 0)
    far = {key: 1e6 for key in limit.keys}
    for traces in secants(problem, problem.train, base, limit, far):
        assert all(np.all(np.abs(trace) < 1e-9) for trace in traces)

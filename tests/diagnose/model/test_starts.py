"""Where a machine rests at first, its place is found though a speed would look the same."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from firmloop.diagnose.model.candidate import unseen_residuals
from firmloop.diagnose.model.fit import fit, noises_of
from firmloop.diagnose.model.hypothesis import Point, entered, first_point
from firmloop.identify.fitting.noise import white
from tests.diagnose.cases import drawn, problem_of, truths

SEED = 780124  # a stage that rests at first, of dry friction and a slew rate


def test_a_stage_at_rest_is_found_where_it_is(tmp_path: Path) -> None:
    problem = problem_of(drawn(tmp_path, SEED))
    terms = [term for term in map(problem.term, ("asymmetric_friction", "slew_rate_limit")) if term is not None]
    begin = first_point(problem, problem.train)
    values = {**begin.values, "mass_kg": 12.0, "b_N_s_m": 30.0}
    for term in terms:
        told = truths(tmp_path, term.effect.name)
        values = dict(entered(values, term, {key: told[key.split(".")[1].split("_")[0]] for key in term.keys}))
    found = fit(problem, problem.train, terms, Point(values, begin.starts), [white(1.44e-6)], 40)
    for _ in range(4):
        found = fit(problem, problem.train, terms, found.point, noises_of(problem, found.residuals), 40)
    train, test = (
        float(np.sqrt(np.mean(np.concatenate(parts) ** 2)))
        for parts in (found.residuals, unseen_residuals(problem, found, noises_of(problem, found.residuals)))
    )
    assert test < 1.01 * train

"""Where a machine rests at first, its place is found though a speed would look the same; and where a swing begins."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from firmloop.diagnose.model.candidate import unseen_residuals
from firmloop.diagnose.model.fit import fit, fit_starts, noises_of
from firmloop.diagnose.model.hypothesis import Point, entered, first_point
from firmloop.diagnose.model.slopes import residual_of
from firmloop.identify.fitting.noise import white
from tests.diagnose.cases import drawn, logged, problem_of, truths
from tests.diagnose.search.test_free_swing import INERTIA, PROJECT

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


def test_a_free_swing_is_found_where_it_begins_however_long_it_goes_on(tmp_path: Path) -> None:
    angle, speed, step, finer, read = 2.0, 3.0, 0.02, 200, []
    for _ in range(3000):
        read.append(angle)
        for _ in range(finer):
            speed -= step / finer * (40.0 * np.sin(angle) + 0.02 * speed)
            angle += step / finer * speed
    noisy = np.array(read) + np.random.default_rng(2).normal(0.0, 2e-3, 3000)
    text = PROJECT.format(pulled="sin(angle_rad)", stiffness=40.0 * INERTIA, damping=0.02 * INERTIA)
    text = text.replace("swing.csv", "log.csv")
    head = "time_s,torque_N_m,angle_rad"
    problem = problem_of(logged(tmp_path, text, head, step * np.arange(3000), np.zeros(3000), noisy))
    values = {each.name: each.value for each in problem.plant.parameters}
    point = fit_starts(problem, problem.train, values, [white(2e-3)])
    assert np.std(residual_of(problem, problem.train[0], point, 0)) < 6e-3

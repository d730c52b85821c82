"""A step beside its bounds: what would leave them is held there, and all else takes its best step beside that."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import lsq_linear

from firmloop.diagnose.model.bounded_step import solved, solved_within
from firmloop.diagnose.model.fit import fit
from firmloop.diagnose.model.hypothesis import Point, entered, first_point
from firmloop.identify.fitting.noise import white
from tests.diagnose.arm import MOTOR, NOISE, PULL, hung
from tests.diagnose.cases import problem_of


def test_two_that_trade_with_each_other_meet_a_bound() -> None:
    slopes = np.array([[1.0, 0.99], [0.0, 0.1]])
    aim = np.array([1.0, -1.0])  # without bounds: 10.9 and -10
    normal, pulled = slopes.T @ slopes, slopes.T @ aim
    assert solved(normal, pulled, 0.0) == pytest.approx([10.9, -10.0], rel=1e-6)
    step = solved_within(normal, pulled, 0.0, np.array([-5.0, -2.0]), np.array([20.0, 2.0]))
    bounded = lsq_linear(slopes, aim, bounds=([-5.0, -2.0], [20.0, 2.0]), tol=1e-14, method="bvls")
    assert step == pytest.approx(bounded.x, rel=1e-6)
    assert step == pytest.approx([2.98, -2.0])  # cut off it would be (10.9, -2), which costs 80 times as much


@given(seed=st.integers(0, 2**31), count=st.integers(1, 6), own=st.integers(0, 3))
def test_a_step_stays_inside_and_what_is_free_is_at_its_best(seed: int, count: int, own: int) -> None:
    rng = np.random.default_rng(seed)
    slopes = rng.standard_normal((20, count + own))
    pulled = slopes.T @ (3.0 * rng.standard_normal(20))
    normal = slopes.T @ slopes
    down, up = -rng.exponential(0.2, count), rng.exponential(0.2, count)
    down[rng.random(count) < 0.3] = 0.0
    up[rng.random(count) < 0.3] = np.inf
    step = solved_within(normal, pulled, 0.0, down, up)
    assert np.all(step[:count] >= down) and np.all(step[:count] <= up)
    held = np.zeros(count + own, dtype=bool)
    held[:count] = (step[:count] == down) | (step[:count] == up)
    left = pulled - normal @ step
    assert left[~held] == pytest.approx(0.0, abs=1e-7)
    assert step @ (2.0 * pulled - normal @ step) >= -1e-9, "it costs more than no step"


def test_a_fit_goes_on_along_a_bound(tmp_path: Path) -> None:
    """Resistance, inertia and pull of an arm trade with each other while its friction is at nothing."""
    problem = problem_of(hung(tmp_path, 0.4, 4.0, seed=7))
    term = problem.term("gravity_torque")
    assert term is not None
    begin = first_point(problem, problem.train)
    values = {
        **begin.values,
        "R_ohm": 0.5 * MOTOR.resistance,
        "ke_V_s_rad": MOTOR.constant,
        "kt_N_m_A": MOTOR.constant,
        "J_kg_m2": 2.0 * MOTOR.inertia,
        "b_N_m_s_rad": 0.0,
    }
    start = Point(entered(values, term, dict(zip(term.keys, (2.0 * PULL, 0.0), strict=True))), begin.starts)
    sizes = [white(NOISE)]
    first = fit(problem, problem.train, (term,), start, sizes, 12)
    assert first.point.values["b_N_m_s_rad"] == 0.0
    then = fit(problem, problem.train, (term,), first.point, sizes, 24)
    assert then.cost < first.cost - 100.0  # with the step cut off at the bound: 1.3 less

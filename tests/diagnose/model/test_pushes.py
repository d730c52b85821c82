"""Where a slow force pushes a stage towards its stop, intervals hold the truth; noise of readings alone does not."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bench.diagnose.blind_cases import single_case
from firmloop.diagnose.model.disturbed_plant import sensors_remember
from firmloop.diagnose.model.fit import Fitted, deviations, ended, noises_of
from firmloop.diagnose.model.hypothesis import Point, Problem, entered, first_point
from firmloop.diagnose.model.sandwich_covariance import answering, batches, doubtful, pushed, sizes_of, with_pushes
from firmloop.identify.fitting.noise import Noise, white
from tests.diagnose.cases import BY_NAME, problem_of, refitted, truths, written

CASES = 8


def _fitted(
    place: Path, seed: int, effect: str, sensors: tuple[str, ...], colored: bool
) -> tuple[Problem, Fitted, tuple[Noise, ...], float]:
    """Return a fit of one effect that begins at the truth, and the truth of its first parameter."""
    problem = problem_of(
        written(place, single_case(seed, effect, BY_NAME["linear_stage"], sensors, "triangle", colored, 0.3))
    )
    term = problem.term(effect)
    assert term is not None
    begin = first_point(problem, problem.train)
    first = next(iter(truths(place, effect).values()))
    values = entered(begin.values, term, {**problem.starts[term.label][-1], term.keys[0]: first})
    found, noises = refitted(problem, term, Point(values, begin.starts), [1e-3] * len(sensors))
    return problem, ended(problem, found, noises), noises, first


def test_intervals_of_a_stop_hold_the_truth_under_a_slow_force(tmp_path: Path) -> None:
    held = {"readings": 0, "pushes": 0}
    for seed in range(CASES):
        problem, found, noises, truth = _fitted(tmp_path / str(seed), seed, "end_stop", ("position",), True)
        key = found.terms[0].keys[0]
        off = abs(found.point.values[key] - truth)
        for name, each in (("readings", found), ("pushes", with_pushes(problem, found, noises))):
            held[name] += off < 1.96 * deviations(each)[key]
    assert held["readings"] <= CASES // 2, "or the cases show nothing"
    assert held["pushes"] >= CASES - 1


def test_an_effect_is_certain_beside_pushes_that_do_not_make_it(tmp_path: Path) -> None:
    problem, found, noises, _ = _fitted(tmp_path, 3, "coulomb_friction", ("speed",), True)
    assert doubtful(with_pushes(problem, found, noises), noises) is None
    little = {found.terms[0].keys[0]: 2.0 * deviations(with_pushes(problem, found, noises))[found.terms[0].keys[0]]}
    small = replace(found, point=replace(found.point, values={**found.point.values, **little}))
    assert doubtful(with_pushes(problem, small, noises), noises) is found.terms[0]
    assert doubtful(small, [white(noise.rms) for noise in noises]) is None


def test_pushes_say_no_more_than_noise_where_that_is_what_they_make(tmp_path: Path) -> None:
    problem, found, noises, _ = _fitted(tmp_path, 3, "coulomb_friction", ("speed",), True)
    wider = with_pushes(problem, found, noises).wider
    assert wider is not None and np.all(wider < 2.0)


def test_pushes_that_a_sensor_at_its_limit_hardly_shows_widen_nothing(tmp_path: Path) -> None:
    for seed in range(3):
        case = single_case(seed, "sensor_saturation", BY_NAME["small_motor"], ("speed",), "staircase", True, 0.3)
        problem = problem_of(written(tmp_path / str(seed), case))
        term = problem.term("sensor_saturation")
        assert term is not None
        point = first_point(problem, problem.train)
        (limit,) = truths(tmp_path / str(seed), "sensor_saturation").values()
        found, noises = refitted(
            problem, term, Point(entered(point.values, term, {term.keys[0]: limit}), point.starts), [1.0]
        )
        found = ended(problem, found, noises)
        readings, pushes = (deviations(each)[term.keys[0]] for each in (found, with_pushes(problem, found, noises)))
        assert pushes < 2.0 * readings


def test_a_memory_is_the_sensors_where_that_is_likelier_than_a_push(tmp_path: Path) -> None:
    """Pushes would widen the deviations of a load 260 times where only a filtered sensor is slow."""
    problem, found, noises, _ = _fitted(tmp_path, 3, "coulomb_friction", ("speed",), True)
    assert not sensors_remember(problem, found.point.values, found.residuals)
    rng, size = np.random.default_rng(2), noises[0].scale
    sensor = Noise(np.array([-0.9]), size, size)
    slow = tuple(sensor.color(rng.normal(0.0, size, each.shape)) for each in found.residuals)
    assert sensors_remember(problem, found.point.values, slow)
    filtered = replace(found, residuals=slow)
    assert with_pushes(problem, filtered, noises_of(problem, slow)) is filtered


def test_noise_without_memory_is_no_push(tmp_path: Path) -> None:
    problem, found, noises, _ = _fitted(tmp_path, 3, "coulomb_friction", ("speed",), False)
    assert with_pushes(problem, found, noises) is found


def test_a_push_that_moves_nothing_says_nothing(tmp_path: Path) -> None:
    """Where friction holds a shaft, rounding is all that a push leaves: it would take a million times the effort."""
    problem, found, noises, _ = _fitted(tmp_path, 3, "coulomb_friction", ("speed",), True)
    moves = pushed(problem, found, 0, batches(problem.train[0], 5))
    assert moves is not None
    held = 1e-12 * np.random.default_rng(1).normal(size=(*moves.shape[:2], 3))
    with_held = np.concatenate([moves, held], axis=2)
    seen = (found.residuals[0],)
    (alone,), (beside,) = (sizes_of(problem, found, noises, 0, each, seen) for each in (moves, with_held))
    assert beside.sizes == pytest.approx(alone.sizes) and beside.left == pytest.approx(alone.left)


def test_what_only_the_given_values_tell_follows_no_push() -> None:
    slopes = np.array([[1e5, -1e5, 0.0], [0.0, 0.0, 1e4]])  # the first two only show by their difference
    tether = np.array([[3.0, 0.0, 0.0, 1.0], [0.0, 3.0, 0.0, 1.0]])
    known = tether[:, :-1].T @ tether[:, :-1]
    pushed_along = answering(slopes.T @ slopes + known, tether) @ np.array([1.0, 1.0, 1.0])
    assert np.allclose(pushed_along, [0.0, 0.0, 1e-8], rtol=1e-6, atol=1e-12)
    free = np.zeros((0, 4))
    whole = slopes.T @ slopes + np.eye(3)
    assert np.allclose(answering(whole, free), np.linalg.inv(whole), rtol=1e-6)

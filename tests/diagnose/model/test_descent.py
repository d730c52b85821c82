"""A descent: no simulation that promises nothing, none that takes far too long, slopes that a step has amended."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from firmloop.diagnose.model import descent, slopes
from firmloop.diagnose.model.descent import Place, SumOfSquares, descended, past_kink
from firmloop.diagnose.model.fit import tethers
from firmloop.diagnose.model.hypothesis import Point, Problem, coordinates, entered, first_point, outputs_of
from firmloop.diagnose.model.slopes import residual_of
from firmloop.identify.fitting.noise import white
from firmloop.identify.recordings.recording import Recording
from tests.diagnose.cases import concealed, problem_of

NAME = "coulomb_friction"
Array = NDArray[np.float64]


@pytest.fixture
def squares(tmp_path: Path) -> tuple[SumOfSquares, Point]:
    """Return a sum of squares of a motor with friction, and where its fit begins."""
    problem = problem_of(concealed(tmp_path, NAME, 0.1, False))
    term = problem.term(NAME)
    assert term is not None
    begin = first_point(problem, problem.train)
    begin = Point(entered(begin.values, term, problem.starts[term.label][0]), begin.starts)
    unknowns = coordinates(problem, (term,), begin.values)
    spreads = [float(np.std(problem.train[0].columns[signal.name])) for signal in problem.plant.outputs]
    noises = [white(1e-3 * each) for each in spreads]
    return SumOfSquares(problem, problem.train, unknowns, noises, tethers(problem, unknowns)), begin


def test_where_no_step_promises_anything_none_is_simulated(
    squares: tuple[SumOfSquares, Point], monkeypatch: pytest.MonkeyPatch
) -> None:
    made, begin = squares
    place, _ = descended(made, begin, 24)
    simulated: list[Point] = []
    at = SumOfSquares.at

    def counted(self: SumOfSquares, point: Point, near: Place | None = None) -> Place:
        simulated.append(point)
        return at(self, point, near)

    monkeypatch.setattr(SumOfSquares, "at", counted)
    again, _ = descended(made, place.point, 24)
    assert place.cost < 0.1 * at(made, begin).cost
    assert again.whole == place.whole
    assert len(simulated) == 1  # the place it begins at


def test_a_simulation_of_too_many_steps_counts_as_diverged(squares: tuple[SumOfSquares, Point]) -> None:
    made, begin = squares
    took = made.at(begin).took[0]
    recording = made.recordings[0]
    assert np.all(np.isfinite(residual_of(made.problem, recording, begin, 0, 3.0 * took)))
    assert np.all(np.isnan(residual_of(made.problem, recording, begin, 0, 0.2 * took)))


def test_a_trial_may_take_ten_times_as_long_as_where_it_begins_and_no_longer(
    squares: tuple[SumOfSquares, Point],
) -> None:
    made, begin = squares
    here = made.at(begin)
    assert made.at(begin, here).finite
    assert not made.at(begin, replace(here, took=tuple(0.05 * each for each in here.took))).finite


def test_amended_slopes_tell_what_a_step_has_done(squares: tuple[SumOfSquares, Point]) -> None:
    made, begin = squares
    before = made.at(begin)
    own_slopes = made.slopes(before)
    size = len(made.unknowns) + len(made.problem.engine.states) * len(made.recordings)
    step = np.full(size, 1e-2)
    place = made.at(made.moved(begin, step))
    amended = made.amended(own_slopes, before, place)
    noises, count = made.noises, len(made.unknowns)
    for k, (flat, own) in enumerate(zip(amended, own_slopes, strict=True)):
        states = (size - count) // len(made.recordings)
        moved = np.concatenate([step[:count], step[count + states * k : count + states * (k + 1)]])
        change = before.residuals[k] - place.residuals[k]
        whole = np.concatenate([noise.whiten(change[:, index]) for index, noise in enumerate(noises)])
        assert flat @ moved == pytest.approx(whole, rel=1e-6, abs=1e-6 * float(np.max(np.abs(whole))))
        assert not math.isclose(float(np.sum((own @ moved - whole) ** 2)), 0.0)


def test_what_a_step_promises_is_not_what_is_left_of_it_once_it_is_cut_short(
    squares: tuple[SumOfSquares, Point], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Cut coordinate by coordinate it may promise nothing, and lead on all the same: a servo's friction was lost so."""
    made, begin = squares
    place = made.at(begin)
    tall = made.slopes(place)
    normal, pulled = made.normal(tall), made.descent(tall, place)
    whole, promise = made.step(normal, pulled, 0.0, begin)
    monkeypatch.setattr(descent, "LONGEST_STEP", 1e-9)
    short, same = made.step(normal, pulled, 0.0, begin)
    assert promise > 0.0
    assert same == promise
    assert np.max(np.abs(short[: len(made.unknowns)])) <= 1e-9 < np.max(np.abs(whole[: len(made.unknowns)]))


def test_a_valley_whose_floor_is_a_kink_is_followed_along_it(
    squares: tuple[SumOfSquares, Point], monkeypatch: pytest.MonkeyPatch
) -> None:
    """As where a shaft just comes to rest: to either side residuals grow, and slopes to one side lead nowhere."""
    made, begin = squares
    made = replace(made, unknowns=made.unknowns[:2], tether=np.zeros((0, 3)), noises=[white(1.0)] * len(made.noises))

    def left(problem: Problem, recording: Recording, point: Point, index: int, most: float = math.inf) -> Array:
        x, y = (each.inner(point.values[each.name]) - each.inner(begin.values[each.name]) for each in made.unknowns)
        rows = np.zeros_like(outputs_of(problem, recording))
        rows[:2, 0] = 1.0 + 10.0 * abs(x - y), 2.0 - x - y
        return rows

    monkeypatch.setattr(descent, "residual_of", left)
    monkeypatch.setattr(slopes, "residual_of", left)
    monkeypatch.setattr(
        slopes, "_anchored", lambda *asked: np.zeros((*left(*asked[:2], begin, 0).shape, len(asked[3])))
    )
    assert made.at(begin).cost == pytest.approx(5.0)
    place, _ = descended(made, begin, 24)
    assert place.cost == pytest.approx(5.0)
    lower = past_kink(made, place)
    assert lower is not None
    assert lower.cost == pytest.approx(1.0, abs=0.05)

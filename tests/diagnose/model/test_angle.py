"""The angle that waves follow: a recorded one, without what its sensor and the clock do to it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bench.diagnose.blind_cases import draw_case
from firmloop.diagnose.model.angle import strayed, walked
from firmloop.diagnose.model.candidate import rated
from firmloop.diagnose.model.fit import fit
from firmloop.diagnose.model.hypothesis import Point, coordinates, follows_simulated, make_problem
from firmloop.diagnose.policy import FINE_DIFFERENCE_STEP
from firmloop.identify.fitting.noise import white
from firmloop.identify.plants.attach import with_effects
from firmloop.identify.plants.plant import EffectUse
from firmloop.identify.simulation.simulate import rest_start, simulate
from tests.diagnose.cases import concealed, laid, problem_of, said_of, simulated, without_tests
from tests.diagnose.test_truth import made

WRONG: Mapping[str, tuple[str | None, Mapping[str, float]]] = {
    "sensor_lag": ("position_rad", {"time_constant_s": 5e-3}),
    "sensor_delay": ("position_rad", {"delay_s": 4e-3}),
    "sensor_gain": ("position_rad", {"gain": 1.1}),
    "eccentric_encoder": ("position_rad", {"amplitude_rad": 0.2, "phase_rad": 1.0}),
    "clock_skew": (None, {"ratio": 0.01}),
    "sensor_offset": ("current_A", {"offset_A": 0.1}),
    "coulomb_friction": (None, {"torque_N_m": 5e-3}),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_recorded_angle_without_what_its_sensor_does(name: str, tmp_path: Path) -> None:
    plant, shown = made(tmp_path, "flat_motor", "eccentric_encoder")
    bare = with_effects(plant, ())
    output, values = WRONG[name]
    use = EffectUse(name, output, values)
    begin = rest_start(bare, shown)
    true = simulate(bare, shown, begin)[:, 0]
    columns = dict(zip(("position_rad", "current_A"), simulate(with_effects(bare, [use]), shown, begin).T, strict=True))
    recording = replace(shown, columns={**shown.columns, **columns})
    problem = make_problem(bare, [recording], [], np.full(2, 1e-9))
    (term,) = (each for each in problem.terms if (each.effect.name, each.output) == (name, output))
    point = Point(
        {p.name: p.value for p in bare.parameters} | dict(zip(term.keys, values.values(), strict=True)),
        (np.zeros(len(problem.engine.states)),),
    )
    candidate = rated(problem, fit(problem, problem.train, (term,), point, [white(1e-3)] * 2, 0))
    off = strayed(problem, candidate)
    if output != "position_rad" and name != "clock_skew":
        assert off == {}, "it moves no reading of the angle"
        return
    problem.engine.amend(off)
    angle = problem.engine.angle(recording)
    assert angle is not None
    moved = float(np.max(np.abs(columns["position_rad"] - true)))
    assert moved > 0.1
    assert float(np.max(np.abs(angle - true))) < 0.01 * moved


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("gravity_torque", {"amplitude_N_m": 5e-3, "phase_rad": 0.3}),
        ("cogging_torque", {"amplitude_N_m": 5e-3, "periods_per_rev": 10.0, "phase_rad": 0.3}),
    ],
)
def test_a_wave_follows_the_recorded_angle_where_the_simulated_is_off_by_a_quarter_of_its_period(
    name: str, values: dict[str, float], tmp_path: Path
) -> None:
    """A force at a recorded place knows the answer: it pulls the simulation to where the machine was."""
    plant, shown = made(tmp_path, "flat_motor", "eccentric_encoder")
    engine = make_problem(with_effects(plant, ()), [shown], [], np.full(2, 1e-9)).engine
    whole = {f"{name}.{key}": value for key, value in values.items()}
    start, quarter = np.zeros(len(engine.states)), 0.5 * np.pi / values.get("periods_per_rev", 1.0)
    engine.follow(False)
    own = engine.simulate(shown, whole, start)
    engine.follow(True)
    engine.lose(0.99 * quarter)
    np.testing.assert_array_equal(engine.simulate(shown, whole, start), own)
    engine.lose(1.01 * quarter)
    assert np.max(np.abs(engine.simulate(shown, whole, start) - own)) > 1e-3


def test_lines_through_random_walks_are_as_uncertain_as_many_of_them_show() -> None:
    rng, step = np.random.default_rng(7), 3e-3
    angles = [np.cumsum(rng.uniform(0.0, 0.3, rows)) for rows in (700, 1100)]
    line = np.concatenate([np.stack([np.ones(len(each)), each], axis=1) for each in angles])
    told, rest = [], []
    for _ in range(1500):
        walk = np.concatenate([np.cumsum(step * rng.normal(size=len(each))) for each in angles])
        told.append(np.linalg.lstsq(line, walk, rcond=None)[0])
        rest.append(np.mean((walk - line @ told[-1]) ** 2))
    spread, left = walked(angles, [step] * 2)
    assert np.cov(np.array(told).T) == pytest.approx(spread, rel=0.15)
    assert np.mean(rest) == pytest.approx(left, rel=0.1)


@pytest.mark.slow  # that of one that follows the simulated angle: tests/diagnose/search/test_valleys.py
def test_the_interval_of_a_wave_that_follows_a_noisy_speed_holds_its_periods(tmp_path: Path) -> None:
    case = replace(draw_case(1140034, "single"), seed=2)  # eight periods a turn; the angle is off by half a period
    said = said_of(without_tests(laid(tmp_path, simulated(lambda: case))))
    (effect,) = said["effects"]
    assert effect["name"] == "cogging_torque"
    low, high = effect["parameters"]["periods_per_rev"]["ci95"]
    assert low < 8.0 < high and high - low < 0.05


@pytest.mark.parametrize(
    ("lost", "recorded", "simulated_one"), [(0.1, True, True), (0.3, True, False), (0.3, False, True)]
)
def test_a_wave_follows_the_simulated_angle_until_that_is_off_by_a_quarter_of_its_period(
    lost: float, recorded: bool, simulated_one: bool, tmp_path: Path
) -> None:
    problem = problem_of(concealed(tmp_path, "", 0.3, False))
    problem.engine.follow(recorded)
    problem.engine.lose(lost)
    term = problem.term("cogging_torque")
    assert term is not None
    values = dict(zip(term.keys, (1e-3, 8.0, 0.0), strict=True))
    assert follows_simulated(problem, term, values) is simulated_one
    steps = {each.name: each.step for each in coordinates(problem, (term,), values)}
    assert (steps["J_kg_m2"] == FINE_DIFFERENCE_STEP) is simulated_one

"""Where fits end: on the scale of torques as given, with inertias split, past contacts, in honest intervals."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bench.diagnose.blind_cases import draw_case
from firmloop.diagnose.contact import grown
from firmloop.diagnose.descent import Problem
from firmloop.diagnose.given import runaways
from firmloop.diagnose.hypothesis import Cause, Point, Scene, coordinates, entered, first_point
from firmloop.diagnose.refit import Fitted, fit, noises_of, tethers
from firmloop.diagnose.torque_scale import near_given
from firmloop.identify.fitting.noise import white
from firmloop.identify.plants.effects import find_effect
from tests.diagnose.cases import diagnosis, drawn, scene_of

TORQUES = ("kt_N_m_A", "J_kg_m2", "b_N_m_s_rad")


def test_torques_keep_the_scale_that_is_given(tmp_path: Path) -> None:
    scene = scene_of(drawn(tmp_path, 470089))
    begin = first_point(scene, scene.train)
    unknowns = coordinates(scene, (), begin.values)
    noises = [white(float(np.std(scene.train[0].columns[signal.name]))) for signal in scene.plant.outputs]
    problem = Problem(scene, scene.train, unknowns, noises, tethers(scene, unknowns))
    place = near_given(problem, problem.at(begin))
    away = problem.at(
        replace(place.point, values={**place.point.values, **{k: 1.3 * place.point.values[k] for k in TORQUES}})
    )
    assert away.cost == pytest.approx(place.cost, rel=1e-6)
    back = near_given(problem, away)
    assert back.whole < away.whole
    for key in TORQUES:
        assert back.point.values[key] == pytest.approx(place.point.values[key], rel=1e-3)


def test_a_simulation_that_has_diverged_costs_most(tmp_path: Path) -> None:
    """However fine a sensor, what is a million times its noise away is nearer than what is nowhere."""
    scene = scene_of(drawn(tmp_path, 470089))
    begin = first_point(scene, scene.train)
    spreads = [float(np.std(scene.train[0].columns[signal.name])) for signal in scene.plant.outputs]
    problem = Problem(scene, scene.train, (), [white(1e-6 * each) for each in spreads], np.zeros((0, 1)))
    here, gone = problem.at(begin), problem.at(replace(begin, values={**begin.values, "b_N_m_s_rad": -1e3}))
    assert here.finite and not gone.finite
    assert here.cost < gone.cost


@pytest.mark.parametrize(("share", "away"), [(0.5, False), (0.2, True)])
def test_an_inertia_that_was_split_has_not_run_away(share: float, away: bool, tmp_path: Path) -> None:
    scene = scene_of(drawn(tmp_path, 470076))
    cause, begin = scene.cause("flexible_coupling"), first_point(scene, scene.train)
    assert cause is not None and cause.taken is not None
    load, held = cause.taken
    given = begin.values[held]
    start = {**scene.starts[cause.label][0], load: 0.5 * given}
    values = {**entered(begin.values, cause, start), held: share * given - (0.1 * given if away else 0.0)}
    fitted = Fitted((cause,), (), Point(values, begin.starts), (), 0.0, (), np.zeros((0, 0)))
    assert (held in runaways(scene, fitted)) is away


@pytest.mark.parametrize(("levels", "simpler"), [((1.0, 1.02), "coulomb_friction"), ((1.0, 1.2), "")])
def test_friction_alike_in_both_directions_is_dry_friction(
    levels: tuple[float, float], simpler: str, tmp_path: Path
) -> None:
    becomes = find_effect("asymmetric_friction").becomes
    cause = scene_of(drawn(tmp_path, 470076)).cause("asymmetric_friction")
    assert becomes is not None and cause is not None
    assert becomes(levels, cause.scales) == simpler


@pytest.mark.parametrize(
    "seed",
    [
        pytest.param(490063, id="a load beside a slow disturbance"),
        pytest.param(470076, id="a coupling in a curved valley", marks=pytest.mark.slow),
        pytest.param(490014, id="a gap that a position shows to a fiftieth", marks=pytest.mark.slow),
    ],
)
def test_intervals_hold_what_is_true(seed: int, tmp_path: Path) -> None:
    (hidden,) = draw_case(seed).hidden
    status, said = diagnosis(drawn(tmp_path, seed), tmp_path / "out")
    assert status == 1
    (effect,) = said["effects"]
    assert effect["name"] == hidden.name
    (true,) = list(hidden.told.values())[:1]
    low, high = next(iter(effect["parameters"].values()))["ci95"]
    assert low <= true <= high


def with_backlash(scene: Scene, seed: int) -> tuple[Cause, Point]:
    """Return the cause and the point at which the case was made."""
    case = draw_case(seed)
    (hidden,) = case.hidden
    cause, begin = scene.cause("backlash"), first_point(scene, scene.train)
    assert cause is not None
    words = ("gap", "coupled_inertia", "coupling", "coupling_damping")
    true = {key: float(hidden.truth[word]) for key, word in zip(cause.keys, words, strict=True)}
    plant = {"mass_kg": case.machine.values["J"], "b_N_s_m": case.machine.values["b"]}
    return cause, Point({**begin.values, **plant, **true}, begin.starts)


def test_bodies_meet_at_the_same_moment_whatever_the_steps(tmp_path: Path) -> None:
    scene = scene_of(drawn(tmp_path, 490007))
    _, point = with_backlash(scene, 490007)
    fine, coarse = (
        (scene.engine.hasten(steps), scene.engine.simulate(scene.train[0], point.values, point.starts[0]))[1]
        for steps in (0.03, 1.0)
    )
    assert float(np.std(coarse - fine)) < 1e-6  # m, of a stage that moves 0.1 m and more


def test_a_stretch_that_grows_leads_to_a_gap(tmp_path: Path) -> None:
    scene = scene_of(drawn(tmp_path, 680002))
    cause, true = with_backlash(scene, 680002)
    gap = cause.keys[0]
    wide = next(start for start in scene.starts[cause.label] if start[gap] > 0.3 * true.values[gap])
    away = Point({**true.values, **wide}, true.starts)
    begun = fit(scene, scene.train, (cause,), away, [white(0.02)], 12)
    found = grown(scene, begun, noises_of(scene, begun.residuals))
    assert abs(begun.point.values[gap] / true.values[gap] - 1.0) > 0.1
    assert found.point.values[gap] == pytest.approx(true.values[gap], rel=0.01)

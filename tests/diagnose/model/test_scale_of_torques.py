"""Where the angle alone is read, all torques are known but for one factor: an effect is no less certain for that."""

from __future__ import annotations

import json
import math
import tomllib
from pathlib import Path

import numpy as np
import pytest

from firmloop.diagnose.model.fit import deviations, strength
from firmloop.diagnose.model.hypothesis import Point, coordinates, entered, first_point, stepped
from firmloop.diagnose.model.scale_doubt import interval_of
from firmloop.identify.normal import NORMAL_95
from firmloop.identify.plants.effect import size
from tests.diagnose.arm import MOTOR, NOISE, PULL, hung
from tests.diagnose.cases import diagnosis, problem_of, refitted


def test_the_pull_on_an_arm_is_certain_however_little_is_known_of_the_scale(tmp_path: Path) -> None:
    problem = problem_of(hung(tmp_path, 0.4, 4.0))
    term = problem.term("gravity_torque")
    assert term is not None
    begin = first_point(problem, problem.train)
    start = Point(entered(begin.values, term, dict(zip(term.keys, (PULL, 0.0), strict=True))), begin.starts)
    found, _ = refitted(problem, term, start, [NOISE])
    size = found.point.values[term.keys[0]]
    told = NORMAL_95 * deviations(found)[term.keys[0]]
    assert told > 0.8 * size, "or the scale is known"
    assert strength(found, term) > 50.0
    interval = interval_of(term.parameters[0], size, told, NORMAL_95 * size / strength(found, term))
    assert interval is not None and 0.0 < interval[0] < PULL < interval[1]


@pytest.mark.parametrize("reach, known", [(1.0, True), (4.0, True), (50.0, False), (1e6, False)])
def test_a_size_of_which_any_decade_would_do_has_no_interval(reach: float, known: bool) -> None:
    assert (interval_of(size("torque_N_m", "N*m"), 1e-3, 1e-3 * reach, 1e-4) is not None) == known


def test_a_wave_of_known_period_goes_by_its_quadratures(tmp_path: Path) -> None:
    problem = problem_of(hung(tmp_path, 0.4, 1.6))
    term = problem.term("gravity_torque")
    assert term is not None
    unknowns = coordinates(problem, (term,), {})[-2:]
    size, phase = (each.inner(value) for each, value in zip(unknowns, (0.001, 1.0), strict=True))
    here, turn = np.array([size, phase]), unknowns[1].scale
    little = np.array([1e-6, 1e-6])
    assert stepped((term,), unknowns, here, little) == pytest.approx(here + little, abs=1e-10)
    through = stepped((term,), unknowns, here, np.array([-3.0 * size, 0.0]))  # through nothing to the other side
    assert through == pytest.approx([2.0 * size, phase + math.pi / turn])
    aside = stepped((term,), unknowns, here, np.array([-size, 0.5 / turn]))
    assert aside == pytest.approx([0.5 * size, phase + 0.5 * math.pi / turn])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("volts", "phase", "friction", "seed"),
    [
        (0.25, 0.0, 0.0, 5),
        (0.7, 0.4, 0.0, 5),
        (0.8, 0.0, 0.003, 5),
        (0.47, 0.0, 0.0, 6),
        (0.27, 1.57, 0.003, 5),
    ],
    ids=["little", "its zero elsewhere", "with friction", "in a valley", "level, with friction"],
)
def test_an_arm_is_told_by_its_angle_alone(
    volts: float, phase: float, friction: float, seed: int, tmp_path: Path
) -> None:
    status, said = diagnosis(hung(tmp_path, volts, 10.0, phase, friction, seed), tmp_path / "out")
    assert status == 1 and said["verdict"] == "explained", json.dumps(said["says"])
    found = {each["name"]: each["parameters"] for each in said["effects"]}
    assert set(found) == {"gravity_torque", *(["coulomb_friction"] if friction else [])}
    assert found["gravity_torque"]["phase_rad"]["value"] == pytest.approx(phase, abs=0.01)
    inertia = tomllib.loads((tmp_path / "out" / "project.toml").read_text())["plant"]["parameters"]["J_kg_m2"]["value"]
    amplitude = found["gravity_torque"]["amplitude_N_m"]
    assert amplitude["value"] / inertia == pytest.approx(PULL / MOTOR.inertia, rel=0.05)
    assert amplitude["ci95"][0] < PULL < amplitude["ci95"][1]

"""Where the nominal plant follows nothing, the recorded motion itself tells what is missing."""

from __future__ import annotations

from pathlib import Path

import pytest

from firmloop.diagnose.model.equation_error import leads
from tests.diagnose.arm import MOTOR, NOISE, PULL, hung
from tests.diagnose.cases import problem_of, said_of

FRICTION = 0.4 * PULL


def test_an_arm_that_friction_holds_aside_is_led_to_its_weight_and_to_the_friction(tmp_path: Path) -> None:
    problem = problem_of(hung(tmp_path, 1.2, 12.0, friction=FRICTION))
    led = {tuple(term.effect.name for term in terms): point.values for terms, point in leads(problem, [NOISE])}
    values = led["gravity_torque", "coulomb_friction"]
    inertia = values["J_kg_m2"]  # all torques are known but for one factor
    assert values["gravity_torque.amplitude_N_m"] / inertia == pytest.approx(PULL / MOTOR.inertia, rel=0.1)
    assert values["coulomb_friction.torque_N_m"] / inertia == pytest.approx(FRICTION / MOTOR.inertia, rel=0.1)


@pytest.mark.slow
def test_an_arm_that_friction_holds_aside_is_named(tmp_path: Path) -> None:
    said = said_of(hung(tmp_path, 1.2, 12.0, friction=FRICTION))
    assert said["verdict"] == "explained"
    assert {effect["name"] for effect in said["effects"]} == {"coulomb_friction", "gravity_torque"}

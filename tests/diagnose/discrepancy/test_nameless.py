"""Physics that no effect of the library holds is called unknown, and where it sits is said."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from bench.diagnose import nulls
from bench.diagnose.blind_cases import Case, single_case
from tests.conftest import Once
from tests.diagnose.cases import BY_NAME, diagnosed_once, drawn, said_of, said_once

ONE_SIDED = ("one_sided_gain", "flat_motor", ("speed",), "staircase", False)
LOOSE_CONTACT = ("intermittent_drive", "small_motor", ("speed", "current"), "chirp", True)


def _case(outside: str, machine: str, sensors: tuple[str, ...], excitation: str, colored: bool) -> Case:
    return replace(single_case(5, "", BY_NAME[machine], sensors, excitation, colored, 1.0), outside=outside)


@pytest.mark.parametrize(
    ("outside", "machine", "sensors", "excitation", "colored", "equation", "coordinate"),
    [
        (*ONE_SIDED, "torque", "voltage_V"),
        pytest.param(
            "periodic_torque",
            "flat_motor",
            ("speed",),
            "prbs",
            False,
            "torque",
            "time, 7.3 times a second",
            marks=pytest.mark.slow,
        ),
        pytest.param(
            "hysteretic_spring",
            "small_motor",
            ("position", "current"),
            "prbs",
            False,
            "torque",
            "travel of late",
            marks=pytest.mark.slow,
        ),
        pytest.param(
            "angle_dependent_damping",
            "linear_stage",
            ("speed",),
            "prbs",
            False,
            "force",
            "speed, by position_m",
            marks=pytest.mark.slow,
        ),
        pytest.param(*LOOSE_CONTACT, "voltage", "voltage_V, now and then", marks=pytest.mark.slow),
        pytest.param(
            "position_dependent_inertia",
            "flat_motor",
            ("speed", "current"),
            "chirp",
            False,
            "torque",
            "acceleration, by angle (per turn)",
            marks=pytest.mark.slow,
        ),
        pytest.param(
            "viscosity_by_heat",
            "small_motor",
            ("position", "current"),
            "triangle",
            False,
            "torque",
            "speed, by its heat of late",
            marks=pytest.mark.slow,
        ),
    ],
)
def test_what_has_no_name_is_unknown(
    once: Once,
    outside: str,
    machine: str,
    sensors: tuple[str, ...],
    excitation: str,
    colored: bool,
    equation: str,
    coordinate: str,
) -> None:
    case = _case(outside, machine, sensors, excitation, colored)
    said = diagnosed_once(once, outside, case).said if outside == ONE_SIDED[0] else said_once(once, outside, case)
    assert said["verdict"] == "unknown_physics" and said["effects"] == []
    location = said["location"]
    assert isinstance(location, dict)
    assert (location["equation"], location["coordinate"]) == (equation, coordinate)
    fit = said["fit"]
    assert isinstance(fit, dict)
    assert fit["train"]["after"] < 0.85 * fit["train"]["refit"]  # what has no name is modelled all the same
    assert fit["test"]["after"] == fit["test"]["refit"]  # the project that is written stays the refit


def test_the_law_of_what_has_no_name_is_told(once: Once) -> None:
    """A gain that differs between the signs of its input: a torque that grows to one side alone."""
    made = diagnosed_once(once, ONE_SIDED[0], _case(*ONE_SIDED))
    assert made.status == 1
    law = made.said["law"]
    assert isinstance(law, list)
    (low, left), (at, none), (high, right) = law
    assert low < at == 0.0 < high
    assert abs(none) < 0.01 * min(abs(left), abs(right)) and left * right > 0.0
    assert "What has no name" in (made.folder / "out" / "report.html").read_text(encoding="utf-8")


@pytest.mark.slow
def test_a_shape_that_unseen_recordings_contradict_is_a_disturbance(tmp_path: Path) -> None:
    """A stage that dwells at a few places while a slow force acts on it: that force seems to follow the place."""
    assert said_of(drawn(tmp_path, 140026))["verdict"] == "no_mismatch"


@pytest.mark.parametrize(
    "seed",
    [
        pytest.param(955006, id="a load of either run by chance, and a law that holds it"),
        pytest.param(955031, id="a wave along the way that foresees nothing", marks=pytest.mark.slow),
    ],
)
def test_a_random_force_is_neither_a_law_nor_an_effect(seed: int, tmp_path: Path) -> None:
    nulls.write(seed, tmp_path)
    assert said_of(tmp_path / "project.toml")["verdict"] == "no_mismatch"

"""Limits and gains of a cascade's loops that are set on the running controller: its setters, and what they do."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from firmloop.cli import main
from firmloop.design.kinds import kinds
from firmloop.design.law import DesignError
from firmloop.project.project import read_project
from firmloop.quantize.lower.lower import lower
from firmloop.quantize.program import Program
from firmloop.stages.making import design
from firmloop.verify.reference import run, working_type

PROJECT = """schema = 1
name = "winder"
[controller]
kind = "cascade"
period_s = 0.001
[[controller.loops]]
name = "inner"
kind = "pid"
kp = 0.5
ki = 3.0
inputs = { measurement = "current_A" }
tunable = ["u_max"]
ranges = { u_max = [1.0, 24.0] }
[[controller.loops]]
name = "outer"
kind = "pid"
kp = 1.0
ki = 0.5
every = 5
u_min = -3.0
u_max = 3.0
inputs = { reference = "reference_rad_s", measurement = "speed_rad_s" }
tunable = ["kp", "u_max"]
ranges = { kp = [0.0, 2.0], u_max = [0.5, 3.0] }
[signals]
reference_rad_s = { unit = "rad/s", low = -60, high = 60 }
speed_rad_s = { unit = "rad/s", low = -60, high = 60 }
current_A = { unit = "A", low = -4, high = 4 }
output = { unit = "V", low = -24, high = 24 }
[arithmetic]
number = "fixed"
bits = 32
[target]
names = ["host"]
"""
SET = ["outer_kp", "outer_u_max", "inner_u_max"]


@pytest.fixture
def project(tmp_path: Path) -> Path:
    (tmp_path / "winder.toml").write_text(PROJECT)
    return tmp_path / "winder.toml"


def test_what_loops_have_tunable_has_setters_that_are_verified(project: Path, tmp_path: Path) -> None:
    assert main(["verify", str(project), "--out", str(tmp_path / "out"), "--steps", "4000"]) == 0
    told = json.loads((tmp_path / "out" / "manifest.json").read_text())["parameters"]
    assert [each["setter"] for each in told] == [f"winder_set_{name}" for name in SET]
    assert "bool winder_set_inner_u_max(" in (tmp_path / "out" / "winder" / "src" / "winder.h").read_text()


def steady(program: Program, kp: float, command: float, voltage: float) -> tuple[float, float]:
    """Return the voltage after a second with these settings, and what the outer loop commands, beside 40 rad/s."""
    rows = np.tile(np.array([40.0, 0.0, 0.0]), (1, 1000, 1)).astype(working_type(program))
    settings = np.tile(np.array([kp, command, voltage]), (1, 1000, 1)).astype(working_type(program))
    trace = run(program, rows, settings)
    held = [value.name for value in program.state].index("outer_held")
    return float(trace.outputs[0, -1, 0]), float(trace.state[0, -1, held])


def test_a_limit_that_is_set_holds_the_loop_that_it_is_of(project: Path) -> None:
    program = lower(design(read_project(project), None).law, "float64")
    assert [value.name for value in program.parameters] == SET
    assert steady(program, 1.0, 3.0, 5.0) == pytest.approx((5.0, 3.0))
    assert steady(program, 1.0, 0.75, 24.0)[1] == pytest.approx(0.75)


@pytest.mark.parametrize("name", sorted(name for name in kinds() if name != "pid"))
def test_another_kind_says_what_takes_a_value_that_is_set_while_it_runs(name: str) -> None:
    example = kinds()[name].example
    with pytest.raises(DesignError, match="a value of a pid, alone or as a loop of a cascade"):
        kinds()[name].design(replace(example, table={**example.table, "tunable": ["u_max"]}))

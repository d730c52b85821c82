"""A board that claims to hold NaN or an infinity breaks no page: JSON has no word for them, and the page says so."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import NoReturn

import numpy as np
import pytest

from bench.links.scope import PROJECT
from firmloop.project.project import read_project
from firmloop.scope.display import Display, held_of
from firmloop.scope.server import served
from firmloop.stages.board.channels import channels
from firmloop.stages.board.desk import Desk
from firmloop.stages.board.monitoring import program_of
from firmloop.stages.board.tape import Tape
from tests.firmloop.scope.sse import ask


def refused(constant: str) -> NoReturn:
    raise AssertionError(f"{constant} is no JSON")


def strictly(text: str) -> dict:
    return json.loads(text, parse_constant=refused)


@pytest.mark.parametrize("held", [float("nan"), float("inf"), float("-inf")])
def test_a_parameter_without_a_number_is_null_for_the_page(tmp_path: Path, held: float) -> None:
    (tmp_path / "tank.toml").write_text(PROJECT)
    project = read_project(tmp_path / "tank.toml")
    program = program_of(project, "scope").program
    rows = np.zeros(1, [(each.name, "<f4") for each in program.parameters])
    rows["kp"] = held
    tape = Tape(1)
    display = Display("board", program, channels(project, program, (), ()), tape, Desk(tape), 1, held_of(program, rows))
    with served(display, 0) as server:
        page = ask(server.url)[1]
        tape.close()
    found = re.search(r'id="facts">(.*?)</script>', page)
    assert found
    facts = strictly(found[1])
    assert facts["now"] == {"kp": None, "ki": 0.0, "u_max": 0.0, "u_min": 0.0}
    assert {each["name"]: each["value"] for each in facts["tunables"]}["kp"] is None

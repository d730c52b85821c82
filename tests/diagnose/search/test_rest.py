"""Where recordings begin: at rest, where a load and an offset are two things, and at places that nobody measures."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from firmloop.diagnose.model.hypothesis import entered, first_point, make_problem
from firmloop.diagnose.model.slopes import start_slopes
from firmloop.identify.recordings.recording import make_recording
from tests.diagnose.cases import drawn, said_of
from tests.sizes import stage

OFFSET, LOAD = 440098, 410094  # seeds of cases with a speed alone
IN_MOTION = 1300  # rows after which these machines move


@pytest.mark.parametrize(
    ("seed", "skipped", "verdict", "names"),
    [
        # Its test recording takes no part in the choice; of one that reads nothing at rest, only a load is told.
        pytest.param(OFFSET, 0, "ambiguous", "load_torque sensor_offset", id="it reads that much at rest"),
        pytest.param(LOAD, 0, "explained", "load_torque", id="it reads nothing at rest"),
        pytest.param(OFFSET, IN_MOTION, "ambiguous", "load_torque sensor_offset", id="it began in motion"),
    ],
)
def test_where_recordings_begin(seed: int, skipped: int, verdict: str, names: str, tmp_path: Path) -> None:
    project = drawn(tmp_path, seed)
    for part in ("train.csv", "test.csv"):
        head, *rows = (project.parent / part).read_text(encoding="utf-8").splitlines()
        (project.parent / part).write_text("\n".join([head, *rows[skipped:], ""]), encoding="utf-8")
    said = said_of(project)
    assert (said["verdict"], {each["name"] for each in said["effects"]}) == (verdict, set(names.split()))


@pytest.mark.parametrize(("kind", "free"), [("linear_stage", [False, True]), ("ode", [True, True])])
def test_places_count_from_where_the_first_recording_begins(kind: str, free: list[bool]) -> None:
    plant, time = replace(stage("speed_m_s"), kind=kind), np.arange(50) * 1e-3
    columns = {"force_N": np.sin(40.0 * time), "speed_m_s": np.cos(40.0 * time)}
    train = [make_recording(time, columns, name, "") for name in ("first.csv", "second.csv")]
    problem = make_problem(plant, train, [], np.zeros(1))
    term, begin = problem.term("return_spring"), first_point(problem, problem.train)
    assert term is not None
    point = replace(begin, values=entered(begin.values, term, problem.starts[term.label][0]))
    place = [state.startswith("position") for state in problem.engine.states].index(True)
    slopes = [start_slopes(problem, each, point, k, exact=True)[..., place] for k, each in enumerate(problem.train)]
    assert [bool(np.any(each)) for each in slopes] == free

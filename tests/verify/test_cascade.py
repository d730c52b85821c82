"""A position loop around a speed loop around a current loop: three rates, one step, closed by C around the machine."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from firmloop.codegen.emit import emit
from firmloop.codegen.target import load_target
from firmloop.design.design import Design
from firmloop.design.kinds import kinds
from firmloop.design.law import DesignError
from firmloop.project.project import read_project
from firmloop.quantize.lower.lower import lower
from firmloop.stages.making import design
from firmloop.stages.plant import plant_of
from firmloop.verify.build.host import build_host
from firmloop.verify.links.library import LibraryLink
from firmloop.verify.proofs.closed_loop import LoopRun, PlantLoop, close_loop

FILE = Path(__file__).parents[2] / "examples" / "pmsm_foc" / "position.toml"
EXAMPLE = kinds()["cascade"].example


def designed() -> Design:
    project = read_project(FILE)
    return design(project, plant_of(project))


def closed(made: Design, arithmetic: str, course: np.ndarray) -> LoopRun:
    bench = made.bench
    assert bench is not None
    program = lower(made.law, arithmetic)
    link = LibraryLink(build_host(emit(program, "firmloop generate test.toml"), load_target("host")), program)
    return close_loop(program, PlantLoop(bench.plant, course, (bench.told, ""), bench.read_by(made.law.inputs)), link)


@pytest.mark.parametrize("arithmetic", ["float32", "fixed32"])
def test_the_shaft_goes_where_it_is_told(arithmetic: str) -> None:
    """By half a radian and back, tuned by rules alone."""
    course = np.repeat([0.5, 0.0], 2000)
    run = closed(designed(), arithmetic, course)
    seen = run.measurement
    assert np.max(seen) < 0.5 * 1.35, "an integral behind an integrator overshoots, but settles"
    np.testing.assert_allclose(seen[1500:2000], 0.5, atol=0.002)
    np.testing.assert_allclose(seen[3500:], 0.0, atol=0.002)


def test_the_slow_loops_run_every_so_many_periods() -> None:
    """Their commands move in their own samples alone, in all of them first of all."""
    law = kinds()["cascade"].design(EXAMPLE).law
    names = [signal.name for signal in law.last.named]
    random, x = np.random.default_rng(2), np.array(law.start)
    commands = []
    for _ in range(30):
        z = [1e-3 * random.uniform(wire.low, wire.high) for wire in law.inputs]
        x, _, _, named = (np.array(part).ravel() for part in law.last.function(x, z))
        commands.append([named[names.index(f"{loop}_command")] for loop in ("speed", "position")])
    moved = np.any(np.diff(commands, axis=0) != 0, axis=1), np.diff(commands, axis=0)[:, 1] != 0
    assert set(np.flatnonzero(moved[1]) + 1) == {12, 24}
    assert set(np.flatnonzero(moved[0]) + 1) == {4, 8, 12, 16, 20, 24, 28}


LOOPS = EXAMPLE.table["loops"]
WRONG = {
    "no list": ({"loops": 3}, "controller.loops is missing or no list of tables"),
    "no name": ({"loops": [{"kind": "foc"}]}, "loop 1 of the cascade has name = None"),
    "no such kind": ({"loops": [{"name": "a", "kind": "fox"}]}, "loop 'a' has kind = 'fox'"),
    "another rate": ({"loops": [LOOPS[0], LOOPS[1], {**LOOPS[2], "every": 10}]}, "a multiple of the 4 of loop 'speed'"),
    "a fast one": ({"loops": [{**LOOPS[0], "every": 2}]}, "1 for the innermost, which sets the period"),
    "no limit": (
        {"loops": [LOOPS[0], {key: value for key, value in LOOPS[1].items() if key != "u_max"}]},
        "loop 'speed' has no u_max",
    ),
    "another wire": ({"loops": [LOOPS[0], {**LOOPS[1], "commands": "current"}]}, "which is no input of loop 'current'"),
    "no such signal": (
        {"loops": [LOOPS[0], {**LOOPS[1], "inputs": {"measurement": "w"}}]},
        "takes 'w' as its measurement, which [signals] does not hold",
    ),
    "its own key": ({"loops": [LOOPS[0], {**LOOPS[1], "kpp": 1.0}, LOOPS[2]]}, "loop 'speed': controller.kpp = 1.0"),
    "no plant": (
        {"loops": [LOOPS[0], {**LOOPS[1], "tune": "simc"}, LOOPS[2]]},
        "loop 'speed': controller.kp = 0.01 is given",
    ),
    "an idle signal": (
        {"loops": [LOOPS[0], {**LOOPS[1], "inputs": dict.fromkeys(("reference", "measurement"), "speed_rad_s")}]},
        "signals.reference_rad is no input of any loop",
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_is_wrong_is_named(case: str) -> None:
    table, words = WRONG[case]
    with pytest.raises(DesignError) as refused:
        kinds()["cascade"].design(replace(EXAMPLE, table=table))
    assert words in str(refused.value)
    assert "\n" not in str(refused.value)


def test_the_gains_it_was_tuned_to_can_be_kept() -> None:
    made, project = designed(), read_project(FILE)
    assert made.settings is not None
    again = kinds()["cascade"].design(
        replace(
            EXAMPLE,
            name=project.name,
            table=made.settings,
            inputs=project.controller_inputs,
            outputs=project.controller_outputs,
            plant=plant_of(project),
        )
    )
    assert again.law.says == made.law.says and again.settings == made.settings

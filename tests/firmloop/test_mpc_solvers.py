"""A predictive controller through the command line, by each way to find its moves."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import firmloop.quantize.lower.budget as budget
from firmloop.cli import main
from firmloop.quantize.twins.qp import Rows, solve

EXAMPLE = Path(__file__).parents[2] / "examples" / "servo_mpc" / "servo_mpc.toml"
PROJECT = """\
schema = 1
name = "servo"
[controller]
kind = "mpc"
solver = "{solver}"
period_s = 0.01
horizon = 5
A = [[1.0, 0.009612], [0.0, 0.923116]]
B = [[0.002908], [0.57663]]
Q = [200.0, 0.1]
R = 0.01
{more}
[signals]
angle = {{ unit = "rad", low = -2, high = 2 }}
speed = {{ unit = "rad/s", low = -30, high = 30 }}
output = {{ unit = "V", low = -6, high = 6 }}
[arithmetic]
number = "{number}"
[target]
names = ["host", "qemu_mps2_an386", "qemu_microbit"]
"""


def written(folder: Path, solver: str, number: str, more: str = "") -> Path:
    path = folder / "servo.toml"
    path.write_text(PROJECT.format(solver=solver, number=number, more=more))
    return path


def test_a_bound_as_wide_as_the_output_is_said_to_say_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Where the search may end at another move, the bound of a step is all of -6 V to 6 V."""
    assert main(["generate", str(written(tmp_path, "online", "float64")), "--out", str(tmp_path / "out")]) == 0
    said = capsys.readouterr().out
    assert "rounding: the bound, output 12 V, is as wide as the output's whole range and says nothing" in said
    assert "off the law" not in said


@pytest.mark.parametrize("number", ["float32", 'fixed"\nbits = 16 #'])
def test_a_fixed_number_of_iterations(number: str, tmp_path: Path) -> None:
    path, out = written(tmp_path, "fixed_iterations", number), tmp_path / "out"
    assert main(["design", str(path), "--out", str(out)]) == 0
    gains = json.loads((out / "design.json").read_text())["gains"]
    assert 1 < gains["iterations"] < 100 and gains["worst_error_share"] <= 0.01 and gains["judged_states"] > 1000
    assert main(["verify", str(path), "--out", str(out), "--steps", "300", "--target", "host"]) == 0
    verdict = json.loads((out / "verdict.json").read_text())
    assert verdict["verdict"] == "agrees" and verdict["rounding"]["output"]["bound"] < 0.05


@pytest.mark.qemu
@pytest.mark.parametrize("target", ["qemu_mps2_an386", "qemu_microbit"])
def test_iterations_in_fixed_point_on_a_core_with_and_without_a_long_multiplier(target: str, tmp_path: Path) -> None:
    path, out = written(tmp_path, "fixed_iterations", "fixed"), tmp_path / "out"
    assert main(["verify", str(path), "--out", str(out), "--steps", "200", "--target", target]) == 0
    verdict = json.loads((out / "verdict.json").read_text())
    assert (verdict["verdict"], verdict["differences"]) == ("agrees", 0)
    assert 0 < verdict["cost"]["instructions_max"] < 100_000


@pytest.mark.parametrize("number", ["float32", "fixed"])
def test_a_table_of_regions(number: str, tmp_path: Path) -> None:
    path, out = written(tmp_path, "explicit", number), tmp_path / "out"
    assert main(["design", str(path), "--out", str(out)]) == 0
    gains = json.loads((out / "design.json").read_text())["gains"]
    assert gains["regions"] > 20 and gains["depth"] < 15 and gains["worst_error_share"] < 1e-9
    assert main(["verify", str(path), "--out", str(out), "--steps", "300", "--target", "host"]) == 0
    assert json.loads((out / "verdict.json").read_text())["verdict"] == "agrees"


@pytest.mark.qemu
def test_a_table_of_regions_is_read_in_few_instructions(tmp_path: Path) -> None:
    path, out = written(tmp_path, "explicit", "float32"), tmp_path / "out"
    assert main(["verify", str(path), "--out", str(out), "--steps", "300", "--target", "qemu_mps2_an386"]) == 0
    verdict = json.loads((out / "verdict.json").read_text())
    assert (verdict["verdict"], verdict["differences"]) == ("agrees", 0)
    assert verdict["cost"]["instructions_max"] < 400


def test_searches_that_go_round_in_a_range_beyond_floats_are_drawn_until_their_work_is_spent(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A reference of up to 1e9 rad beside an angle of 4: nearly every search in float32 ran to its end, 2000 times."""
    spent: list[int] = []

    def counted(rows: Rows, parameters: np.ndarray) -> object:
        found = solve(rows, parameters)
        spent.append(int(found.work.sum()))
        return found

    monkeypatch.setattr(budget, "solve", counted)
    monkeypatch.setattr(budget, "ALTOGETHER", 1_000_000)
    text = EXAMPLE.read_text().replace("low = -3.2, high = 3.2", "low = -3.2, high = 1e9", 1)
    (tmp_path / "servo.toml").write_text(text)
    assert main(["generate", str(tmp_path / "servo.toml"), "--out", str(tmp_path / "out")]) == 0
    *before, last = spent
    assert 500_000 < sum(before) < 1_500_000 and last > 0

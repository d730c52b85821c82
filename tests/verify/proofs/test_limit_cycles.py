"""Dead bands and limit cycles: textbook cases by hand, every kind within its bound, the word length that is allowed."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from firmloop.cli import main
from firmloop.design.design import Request
from firmloop.design.kinds import design, kinds
from firmloop.identify.signal import Signal
from firmloop.presentation.code_words import about_still
from firmloop.quantize.lower.lower import lower
from firmloop.verify.proofs.limit_cycles import AtRest, ZeroInput, zero_input
from firmloop.verify.reference import run
from tests.verify.test_tunable import PROJECT

WIRES = (Signal("reference", "V", -1.0, 1.0), Signal("measurement", "V", -1.0, 1.0))
OUTPUT = (Signal("output", "V", -100.0, 100.0),)


def shown(pole: float, gain: float, rounds: str) -> tuple[ZeroInput, float, float, set[str]]:
    """What x+ = pole x + e, u = gain x does at rest, the last places of x and of u, V, and what it takes."""
    table = {"A": [[pole]], "B": [[1.0, -1.0]], "C": [[gain]], "D": [[0.0, 0.0]]}
    program = lower(design("state_space", "pole", table, 0.01, WIRES, OUTPUT, None).law, "fixed32", rounds)
    found = zero_input(program)
    assert found is not None
    of_state, of_output = (2.0 ** -values[0].number.fraction for values in (program.state, program.outputs))
    return found, of_state, of_output, {op.function for op in program.body}


def first_order(pole: float, rounds: str = "nearest") -> tuple[ZeroInput, float]:
    """What x+ = pole x + e, u = x does at rest, and the unit in the last place of x, V."""
    found, place, _, functions = shown(pole, 1.0, rounds)
    assert ("high_down" in functions) == (rounds == "floor")
    return found, place


@pytest.mark.parametrize(("pole", "stuck"), [(0.91, 5), (0.5, 1), (0.96, 12)])
def test_a_positive_pole_has_the_dead_band_of_the_textbook(pole: float, stuck: int) -> None:
    """|x| rests where pole |x| rounds to |x|: up to 0.5/(1 - pole), halves rounded up."""
    found, place = first_order(pole)
    (row,) = found.outputs
    assert found.exhaustive and found.unsettled == 0
    assert (row.cycle, row.offset) == (0.0, stuck * place)
    assert row.bound == pytest.approx(0.5 / (1 - pole) * place, rel=2e-3)


@pytest.mark.parametrize(("pole", "stuck"), [(0.91, 11), (0.5, 1), (0.96, 24)])
def test_rounding_down_has_twice_the_dead_band(pole: float, stuck: int) -> None:
    """-|x| rests where -pole |x| is rounded down to -|x|: below 1/(1 - pole)."""
    found, place = first_order(pole, "floor")
    (row,) = found.outputs
    assert found.exhaustive and (row.cycle, row.offset) == (0.0, stuck * place)
    assert row.bound == pytest.approx(1.0 / (1 - pole) * place, rel=2e-3)


@pytest.mark.parametrize(("rounds", "function", "share"), [("nearest", "mul_shift", 0.5), ("floor", "mul_down", 1.0)])
def test_a_product_adds_its_own_rounding_to_the_dead_band(rounds: str, function: str, share: float) -> None:
    found, state, output, functions = shown(0.91, 0.7, rounds)
    (row,) = found.outputs
    assert function in functions
    assert row.bound == pytest.approx(share * (0.7 * state / 0.09 + output), rel=2e-3)


def test_a_negative_pole_has_a_limit_cycle_of_period_two() -> None:
    """4, -3.6 -> -4, 3.6 -> 4, ... is the largest that -0.9 keeps; 5 goes to -4."""
    found, place = first_order(-0.9)
    (row,) = found.outputs
    assert found.exhaustive and (row.cycle, row.offset) == (8 * place, 0.0)
    assert row.bound is not None and row.cycle / 2 <= row.bound


def test_floating_point_is_left_alone() -> None:
    law = design("pid", "x", {"kp": 1.0}, 0.01, WIRES, OUTPUT, None).law
    assert zero_input(lower(law, "float32")) is None


@pytest.mark.parametrize("name", ["lead_lag", "notch", "pid", "state_space", "state_feedback"])
def test_no_kind_leaves_its_bound_once_its_inputs_stand_still(name: str) -> None:
    program = lower(kinds()[name].design(kinds()[name].example).law, "fixed32")
    found = zero_input(program)
    assert found is not None
    random = np.random.default_rng(2)
    still = np.zeros((60, 3000, len(program.inputs)))
    small = np.array([v.high for v in program.inputs]) * 1e-5
    still[:, :40] = random.uniform(-1, 1, size=(60, 40, len(program.inputs))) * small
    integrates = any(v.name == "integral" for v in program.state)
    trace = run(program, np.round(still).astype(np.int32))
    for j, (row, value) in enumerate(zip(found.outputs, program.outputs, strict=True)):
        assert row.bound is not None and row.offset <= row.bound and row.cycle <= 2 * row.bound
        last = trace.outputs[:, -100:, j] * 2.0**-value.number.fraction
        if integrates:  # it keeps what it has gathered; only the swing is of roundings
            last = last - last.mean(axis=1, keepdims=True)
        assert np.max(np.abs(last)) <= row.bound


def project(folder: Path, arithmetic: str) -> Path:
    path = folder / "wheel_speed.toml"
    path.write_text(PROJECT.replace('number = "fixed"\nbits = 16', arithmetic, 1))
    return path


def test_generate_prints_the_bound_at_rest(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    assert main(["generate", str(project(tmp_path, 'number = "fixed"')), "--out", str(out)]) == 0
    said = capsys.readouterr().out
    assert "inputs still: output: no limit cycle" in said and "rounding, proven: at most output" in said
    entry = json.loads((out / "proof.json").read_text())["zero_input"]
    assert entry["exhaustive"] and entry["outputs"]["output"]["bound"] == 0.0  # a PI rounds nothing at rest


def generated_still(folder: Path, table: str, capsys: pytest.CaptureFixture[str]) -> tuple[str, dict[str, Any]]:
    """Return the line on still inputs of a law of one input in 32 bits, and its entry in proof.json."""
    path = folder / "slow.toml"
    path.write_text(
        f'schema = 1\nname = "slow"\n[controller]\nperiod_s = 0.001\n{table}\n[signals]\nx = {{ unit = "V", low = -10, '
        'high = 10 }\noutput = { unit = "V", low = -20, high = 20 }\n[arithmetic]\nnumber = "fixed"\nbits = 32\n'
    )
    assert main(["generate", str(path), "--out", str(folder / "out")]) == 0
    (line,) = [line for line in capsys.readouterr().out.splitlines() if "inputs still" in line]
    return line, json.loads((folder / "out" / "proof.json").read_text())["zero_input"]


def test_a_slow_filter_is_followed_until_its_dead_band_is_found(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Two poles at radius 0.9962 need thousands of steps from 128 starts to where roundings hold them."""
    section = "[0.001, 0.0, 0.0, 1.0, -1.989599859318349, 0.9923293511531972]"
    line, entry = generated_still(tmp_path, f'kind = "transfer_function"\ndomain = "z"\nsections = [{section}]', capsys)
    assert "rests up to" in line and "no dead band" not in line and "not found out" not in line
    assert entry["unsettled"] == 0 and 0 < entry["outputs"]["output"]["offset"] <= entry["outputs"]["output"]["bound"]


def test_what_still_moves_after_the_search_is_told_as_not_found_out(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """At a pole of 0.99999 a start falls by one unit a step, and has up to 50,000 to fall."""
    line, entry = generated_still(
        tmp_path, 'kind = "state_space"\nA = [[0.99999]]\nB = [[1e-5]]\nC = [[1.0]]\nD = [[0.0]]', capsys
    )
    assert 0 < entry["unsettled"] < entry["starts"]
    assert f"not found out for {entry['unsettled']} of them, still moving after {entry['steps']} steps" in line
    assert "no limit cycle found, rests up to" in line


def test_nothing_is_claimed_where_every_start_still_moves() -> None:
    (line,) = about_still(ZeroInput((AtRest("output", "V", 2e-4, 0.0, 0.0),), 128, False, 128, 10_000))
    assert "no limit cycle" not in line and "no dead band" not in line
    assert "not found out (128 starts, all still moving after 10000 steps)" in line


@pytest.mark.parametrize(("most", "bits"), [("0.01", 16), ("1e-4", 32)])
def test_the_word_is_as_long_as_the_error_asks_for(tmp_path: Path, most: str, bits: int) -> None:
    path = project(tmp_path, f'number = "fixed"\nmax_error_V = {most}')
    assert main(["generate", str(path), "--out", str(tmp_path / "out")]) == 0
    manifest = json.loads((tmp_path / "out" / "manifest.json").read_text())
    assert manifest["arithmetic"] == f"fixed{bits}"
    assert manifest["rounding"]["output"]["bound"] <= float(most)


@pytest.mark.parametrize(
    ("arithmetic", "words"),
    [
        ('number = "fixed"\nmax_error_V = 1e-12', "arithmetic.max_error_V = 1e-12 is not kept: fixed16 may put output"),
        ('number = "fixed"\nbits = 16\nmax_error_V = 1e-4', "leave bits out or write bits = 32"),
        ('number = "float32"\nmax_error_V = 1e-9', "float32 may put output"),
        ('number = "fixed"\nmax_error_A = 0.01', "ends in the unit of no output (output is in 'V')"),
        ('number = "fixed"\nmax_error_V = 0', "must be more than 0"),
        ('number = "fixed"\nmax_error_V = "small"', "must be a finite number"),
        ('number = "fixed"\nmaxerror_V = 0.01', "unknown key"),
    ],
)
def test_an_error_that_cannot_be_kept_is_one_clear_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], arithmetic: str, words: str
) -> None:
    assert main(["generate", str(project(tmp_path, arithmetic)), "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    assert words in said and "Traceback" not in said


def test_a_law_without_linear_rest_says_so() -> None:
    kind = kinds()["gain_schedule"]
    assert isinstance(kind.example, Request)
    found = zero_input(lower(kind.design(kind.example).law, "fixed32"))
    assert found is not None and found.outputs[0].bound is None and found.starts == 0

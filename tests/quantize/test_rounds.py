"""Rounding down in place of to nearest: the same C, the same proofs, its own bound; and formats that lose no places."""

from __future__ import annotations

from pathlib import Path

import pytest

from firmloop.cli import main
from firmloop.codegen.emit import emit
from firmloop.codegen.target import load_target
from firmloop.design.kinds import kinds
from firmloop.design.law import Law
from firmloop.quantize.lower.lower import lower
from firmloop.quantize.program import Program
from firmloop.quantize.proof import proof
from firmloop.verify.build.host import build_host
from firmloop.verify.compare import compare
from firmloop.verify.links.library import LibraryLink
from firmloop.verify.proofs.checker import ProofError, check_proof
from firmloop.verify.proofs.limit_cycles import zero_input
from firmloop.verify.proofs.rounding import measure_rounding
from firmloop.verify.reference import run
from firmloop.verify.stimuli.stimuli import stimuli

DOWN = {"high_down", "mul_down", "asr"}
NEAREST = {"high", "mul_shift", "shr"}
PROJECT = """\
schema = 1
name = "rounded"
[controller]
kind = "lead_lag"
period_s = 0.001
zero_rad_s = 10.0
pole_rad_s = 90.0
[signals]
reference = { unit = "m", low = -1, high = 1 }
measurement = { unit = "m", low = -1, high = 1 }
output = { unit = "V", low = -12, high = 12 }
[arithmetic]
"""


def example(kind: str) -> Law:
    return kinds()[kind].design(kinds()[kind].example).law


def functions(program: Program) -> set[str]:
    return {op.function for op in program.body}


def test_nothing_is_rounded_to_nearest_where_down_is_asked_for() -> None:
    for arithmetic in ("fixed32", "fixed16"):
        one, other = (lower(example("transfer_function"), arithmetic, rounds) for rounds in ("nearest", "floor"))
        assert functions(one) & NEAREST and not functions(one) & (DOWN - {"asr"})
        assert functions(other) & (DOWN - {"asr"}) and not functions(other) & NEAREST
        assert one.id != other.id and one.rounds == "nearest"
        assert one.rounding[0].bound < other.rounding[0].bound <= 2.01 * one.rounding[0].bound
    assert "rounding down" in emit(other, "firmloop generate x.toml").files["position_loop.h"]


@pytest.mark.parametrize(("kind", "arithmetic"), [("state_space", "fixed16"), ("notch", "fixed32")])
def test_rounding_down_is_the_same_in_c_and_within_its_bound(kind: str, arithmetic: str) -> None:
    law = example(kind)
    program = lower(law, arithmetic, "floor")
    blocks = stimuli(program, [], 2_000, 5)
    traces = [run(program, block.inputs) for block in blocks]
    for rounded in measure_rounding(law, program, blocks, traces):
        assert rounded.bound / 3 < rounded.worst <= rounded.bound
    library = build_host(emit(program, "firmloop generate test.toml"), load_target("host"))
    done = compare(program, LibraryLink(library, program), blocks, traces, lambda fraction, label: None)
    assert (done.steps, done.differences) == (2_000, 0)


def test_the_checker_knows_what_rounding_down_is() -> None:
    law = example("gain_schedule")
    document = dict(proof(lower(law, "fixed32", "floor"), law.reasons))
    assert check_proof(document) is not None and document["rounds"] == "floor"
    for function in sorted(DOWN):
        broken = [dict(entry) for entry in document["operations"]]
        entry = next(entry for entry in broken if entry["function"] == function and entry["low"] < entry["high"])
        entry["low"] += 1
        with pytest.raises(ProofError, match="breaks its range"):
            check_proof({**document, "operations": broken})


def test_a_program_that_rounds_down_rests_within_its_bound() -> None:
    found = zero_input(lower(example("state_space"), "fixed32", "floor"))
    nearest = zero_input(lower(example("state_space"), "fixed32"))
    assert found is not None and nearest is not None
    for here, there in zip(found.outputs, nearest.outputs, strict=True):
        assert here.bound is not None and there.bound is not None and here.cycle + here.offset <= here.bound
        assert here.bound > 1.5 * there.bound


@pytest.mark.parametrize(
    ("arithmetic", "words"),
    [
        ('number = "fixed"\nrounding = "up"', "must be 'nearest' or 'floor'"),
        ('number = "fixed"\nrounding = 3', "must be 'nearest' or 'floor'"),
        ('number = "float32"\nrounding = "floor"', "a choice of fixed point"),
        ('number = "fixed"\nrounds = "floor"', "rounds"),
    ],
)
def test_a_rounding_that_cannot_be_is_one_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], arithmetic: str, words: str
) -> None:
    file = tmp_path / "rounded.toml"
    file.write_text(PROJECT + arithmetic, encoding="utf-8")
    assert main(["generate", str(file), "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    assert words in said and "Traceback" not in said and "rounded.toml:" in said


def test_a_project_chooses_its_rounding(tmp_path: Path) -> None:
    file = tmp_path / "rounded.toml"
    file.write_text(PROJECT + 'number = "fixed"\nbits = 16\nrounding = "floor"\n', encoding="utf-8")
    assert main(["generate", str(file), "--out", str(tmp_path / "out")]) == 0
    text = (tmp_path / "out" / "rounded" / "src" / "rounded.c").read_text(encoding="utf-8")
    assert "fl_down_i32" in text and "fl_high_i32" not in text


def test_a_limit_of_the_output_does_not_set_the_format_of_a_share() -> None:
    """0 limits both the output, 100 %, and the share of a gap between two points, which is 1 at most."""
    program = lower(example("gain_schedule"), "fixed32")
    fractions = {op.result.name: op.result.number.fraction for op in program.body}
    assert fractions["share_1"] >= 27 and fractions["share_2"] >= 27 and fractions["output_limited"] == 21


def test_a_small_state_keeps_its_places_beside_a_large_one() -> None:
    """Poles crowd z = 1: the dead band is half a place of the last state over the product of the poles' distances."""
    program = lower(example("transfer_function"), "fixed32")
    fractions = {value.name: value.number.fraction for value in program.state}
    assert fractions["w2_2"] >= fractions["w2_1"] + 5
    found = zero_input(program)
    assert found is not None and found.outputs[0].bound is not None
    assert found.outputs[0].offset <= found.outputs[0].bound < 0.0035

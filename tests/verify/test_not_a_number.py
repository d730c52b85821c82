"""A NaN or an infinity at any input of any kind: safe outputs, one status bit, the state kept; none in fixed point."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from firmloop.cli import main
from firmloop.codegen.emit import emit, manifest
from firmloop.codegen.target import load_target
from firmloop.design.kinds import design, kinds
from firmloop.design.law import Law
from firmloop.quantize.lower.lower import lower
from firmloop.quantize.program import Program
from firmloop.quantize.proof import proof
from firmloop.verify.block import Block, run_blocks
from firmloop.verify.build.host import build_host
from firmloop.verify.compare import compare
from firmloop.verify.explain import explain
from firmloop.verify.links.library import LibraryLink
from firmloop.verify.proofs.c_checker import check_header, check_source
from firmloop.verify.proofs.claims import ProofError
from firmloop.verify.proofs.reading import read_claims
from firmloop.verify.reference import element_type, run
from firmloop.verify.run import verify
from firmloop.verify.stimuli.stimuli import singles, stimuli
from tests.laws import FULL, pid

EXAMPLES = {name: request for kind in kinds().values() for name, request in kind.examples.items()}
OWNERS = {name: kind for kind, found in kinds().items() for name in found.examples}
LOST_AT = (0, 5, 6, 9)  # samples in which an input is not finite, the first one and two in a row among them
STEPS = 12
PAYLOADS = {  # numbers that are none, quiet and signalling, and both infinities
    4: (0x7FC00000, 0xFFC00001, 0x7F800001, 0xFFBFFFFF, 0x7F800000, 0xFF800000),
    8: (0x7FF8 << 48, 0xFFF8 << 48 | 1, 0x7FF0 << 48 | 1, 0x7FF0 << 48, 0xFFF0 << 48),
}
MPC = """\
schema = 1
name = "loop"
[controller]
kind = "mpc"
period_s = 0.02
horizon = 5
states = ["position_m", "speed_m_s"]
outputs = ["force"]
A = [[1.0, 0.02], [0.0, 0.98]]
B = [[0.0002], [0.02]]
Q = [10, 0.1]
R = [0.02]
u_min = [-3.0]
u_max = [3.0]
[signals]
position_m = { unit = "m", low = -2, high = 2 }
speed_m_s = { unit = "m/s", low = -6, high = 6 }
force = { unit = "N", low = -4, high = 4 }
[arithmetic]
number = "float32"
[target]
names = ["host"]
"""


def law_of(name: str) -> Law:
    request = EXAMPLES[name]
    return kinds()[OWNERS[name]].design(request).law


def lanes(program: Program) -> tuple[np.ndarray, np.ndarray]:
    """Every input lost in turn, then all of them, by every payload; and the samples that are left."""
    kind = element_type(program.inputs[0].number)
    random = np.random.default_rng(5)
    calm = np.stack([random.uniform(v.low, v.high, STEPS) for v in program.inputs], axis=-1).astype(kind) / 3
    every = list(range(len(program.inputs)))
    found = []
    for places in (*([j] for j in every), every):
        for bits in PAYLOADS[kind.itemsize]:
            rows = calm.copy()
            for k in LOST_AT:
                rows[k, places] = np.array(bits, f"<u{kind.itemsize}").view(kind)
            found.append(rows)
    kept = [k for k in range(STEPS) if k not in LOST_AT]
    return np.stack(found), calm[None, kept]


@pytest.mark.parametrize("arithmetic", ["float32", "float64"])
@pytest.mark.parametrize("name", EXAMPLES)
def test_what_is_not_finite_at_any_input_of_any_kind_commands_the_safe_output_and_is_forgotten(
    name: str, arithmetic: str
) -> None:
    law = law_of(name)
    middle = tuple((0.6 * v.low + 0.4 * v.high) for v in law.outputs)
    for safe in ((), middle):
        program = lower(replace(law, safe=safe), arithmetic)
        inputs, sound = lanes(program)
        trace, undisturbed = run(program, inputs), run(program, sound)
        bit = program.status[-1]
        assert bit.name == "not_a_number" and manifest(program, emit(program, "x"))["status"][-1]["bit"] == bit.bit
        lost, kept = list(LOST_AT), [k for k in range(STEPS) if k not in LOST_AT]
        assert np.all(trace.status[:, lost] == 1 << bit.bit)
        kind = element_type(program.outputs[0].number)
        assert np.all(trace.outputs[:, lost] == np.array(program.safe, kind))
        if safe:
            assert program.safe == pytest.approx(safe)
        assert np.array_equal(trace.outputs[:, kept], np.repeat(undisturbed.outputs, len(inputs), axis=0))
        assert np.array_equal(trace.status[:, kept], np.repeat(undisturbed.status, len(inputs), axis=0))
        blocks = [Block("lost", inputs)]
        library = build_host(emit(program, "firmloop generate test.toml"), load_target("host"))
        done = compare(program, LibraryLink(library, program), blocks, [trace], lambda fraction, label: None)
        assert (done.steps, done.differences) == (inputs.shape[0] * STEPS, 0)


@pytest.mark.parametrize("name", EXAMPLES)
def test_fixed_point_has_no_such_bit(name: str) -> None:
    law = law_of(name)
    try:
        program = lower(replace(law, safe=tuple(v.high for v in law.outputs)), "fixed32")
    except Exception as error:
        assert "float" in str(error)
        return
    plain = lower(law, "fixed32")
    assert program == plain and "not_a_number" not in emit(plain, "x").files[f"{plain.name}.c"]


@pytest.mark.parametrize("name", EXAMPLES)
def test_the_stimuli_bring_nan_and_both_infinities_to_every_input(name: str) -> None:
    program = lower(law_of(name), "float32")
    for blocks in (stimuli(program, [], 20_000, 1), singles(program, 4_000, 1)):
        rows = np.concatenate([block.inputs.reshape(-1, len(program.inputs)) for block in blocks])
        for column in rows.T:
            assert np.isnan(column).any() and {np.inf, -np.inf} <= set(column[np.isinf(column)])


@pytest.mark.parametrize("arithmetic", ["float32", "float64"])
@pytest.mark.parametrize("name", EXAMPLES)
def test_the_largest_numbers_at_any_input_are_numbers(name: str, arithmetic: str) -> None:
    program = lower(law_of(name), arithmetic)
    kind = element_type(program.inputs[0].number)
    wide = float(np.finfo(kind).max) * np.array([[1.0], [-1.0]]) * np.ones(len(program.inputs))
    trace = run(program, wide[:, None].astype(kind))
    assert not np.any(trace.status >> program.status[-1].bit)


@pytest.mark.qemu
@pytest.mark.parametrize("name", ["pid", "mpc", "gain_schedule", "self_tuning"])
def test_the_m4f_does_the_same(name: str) -> None:
    law = law_of(name)
    program = lower(replace(law, safe=tuple(v.high for v in law.outputs)), "float32")
    bundle = emit(program, "firmloop generate test.toml")
    target = load_target("qemu_mps2_an386")
    verdict = verify(law, program, bundle, target, (), 2_000, 1, None, lambda fraction, label: None)
    assert (verdict.steps, verdict.differences) == (2_000, 0)


def test_the_proof_holds_the_c_to_what_an_input_commands_that_is_not_finite() -> None:
    law = replace(pid(FULL), safe=(1.5,))
    program = lower(law, "float32")
    document = json.loads(json.dumps(proof(program, law.reasons)))
    files = emit(program, "x").files
    source, header = files[f"{program.name}.c"], files[f"{program.name}.h"]
    claims = read_claims(document)
    assert check_source(claims, source) > 20 and check_header(claims, header) > 10
    for said, instead in (
        ("out->output = 1.5F", "out->output = 1.25F"),
        ("MOTOR_PID_NOT_A_NUMBER;", "MOTOR_PID_SATURATED;"),
        ("fl_nought_f32(in->reference, in->measurement)", "fl_nought_f32(in->reference, in->reference)"),
        ("if (not_a_number != 0)", "if (not_a_number == 0)"),
    ):
        assert said in source
        with pytest.raises(ProofError):
            check_source(claims, source.replace(said, instead))
    document["outputs"][0]["safe"] = 13.0
    with pytest.raises(ProofError, match="where an input is not finite"):
        read_claims(document)


def test_a_difference_behind_a_nan_is_still_explained() -> None:
    program = lower(pid(FULL), "float32")
    bundle = emit(program, "x")
    lane = np.array([[1.0, 0.5], [np.nan, 0.5], [3.0, 0.5]], np.float32)
    assert "every operation of the same C is right" in explain(program, bundle, lane, 2, "output")
    name = f"{program.name}.c"
    wrong = replace(bundle, files={**bundle.files, name: bundle.files[name].replace("(-12.0F);", "(-11.0F);", 1)})
    assert "step 1: out->output" in explain(program, wrong, lane, 2, "output")


def generated(folder: Path, text: str) -> int:
    (folder / "loop.toml").write_text(text)
    return main(["generate", str(folder / "loop.toml"), "--out", str(folder / "out")])


def test_an_mpc_project_says_its_bit_and_safe_output(tmp_path: Path) -> None:
    for line, safe in (("", -3.0), ("safe_output = 0.5\n", 0.5), ("safe_output = { force = 4.0 }\n", 4.0)):
        assert generated(tmp_path, MPC.replace("horizon", f"{line}horizon", 1)) == 0
        listed = json.loads((tmp_path / "out" / "manifest.json").read_text())["status"]
        assert [bit["name"] for bit in listed] == ["capped", "not_a_number"]
        assert "LOOP_NOT_A_NUMBER = 2" in (tmp_path / "out" / "loop" / "src" / "loop.h").read_text()
        assert json.loads((tmp_path / "out" / "proof.json").read_text())["outputs"][0]["safe"] == safe
        assert main(["prove", str(tmp_path / "out")]) == 0


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("safe_output = 5.0", "outside of signals.force"),
        ("safe_output = nan", "holds nan"),
        ('safe_output = "off"', "safe_output"),
        ("safe_output = { torque = 0.0 }", "no output of the controller; its outputs: force"),
        ("safe_output = { force = -4.5 }", "controller.safe_output.force = -4.5 is outside"),
        ("safe_outputs = 0.0", "safe_output"),
    ],
)
def test_a_wrong_safe_output_is_refused_in_one_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], line: str, words: str
) -> None:
    assert generated(tmp_path, MPC.replace("horizon", f"{line}\nhorizon", 1)) == 2
    said = capsys.readouterr().err.strip()
    assert words in said and "Traceback" not in said and "internal" not in said


PID = """schema = 1
name = "loop"
[controller]
kind = "pid"
period_s = 0.01
kp = 1.0
ki = 2.0
safe_output = -3.0
[signals]
reference = { unit = "degC", low = -50, high = 50 }
measurement = { unit = "degC", low = -50, high = 50 }
output = { unit = "V", low = -12, high = 12 }
[arithmetic]
number = "float32"
[target]
names = ["host"]
"""


@pytest.mark.parametrize("arithmetic", ["float32", 'fixed"\nbits = "16', 'fixed"\nbits = "32'])
def test_a_project_is_told_that_fixed_point_has_no_use_for_its_safe_output(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], arithmetic: str
) -> None:
    text = PID.replace('"float32"', f'"{arithmetic}"').replace('"16"', "16").replace('"32"', "32")
    assert generated(tmp_path, text) == 0
    said = capsys.readouterr().out
    assert said.count("safe_output acts in no sample") == (arithmetic != "float32")
    assert ("command output = -3 V in place of step(), before it is converted" in said) == (arithmetic != "float32")
    assert generated(tmp_path, text.replace("safe_output = -3.0\n", "")) == 0
    assert "safe_output" not in capsys.readouterr().out


def test_a_table_names_some_of_several_outputs() -> None:
    request = EXAMPLES["state_space"]
    table = {**request.table, "safe_output": {"right": 0.25}}
    found = design("state_space", request.name, table, request.period, request.inputs, request.outputs, None)
    plain = lower(kinds()["state_space"].design(request).law, "float32")
    assert lower(found.law, "float32").safe == (plain.safe[0], 0.25)
    assert run_blocks(plain, [Block("lost", np.full((1, 1, len(plain.inputs)), np.nan, np.float32))])

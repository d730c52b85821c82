"""Parameters that can be set on the running target: the setter, the proof over the whole range, host and M4F."""

from __future__ import annotations

import ctypes
import json
import re
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from firmloop.cli import main
from firmloop.codegen.emit import emit
from firmloop.codegen.target import load_target
from firmloop.identify.simulation.compiler import run_compiler
from firmloop.quantize.lower.lower import ARITHMETICS, lower
from firmloop.quantize.proof import proof
from firmloop.verify.block import run_blocks
from firmloop.verify.build.host import FLAGS, build_host
from firmloop.verify.compare import compare
from firmloop.verify.links.library import LibraryLink
from firmloop.verify.proofs.checker import check_proof
from firmloop.verify.proofs.rounding import measure_rounding
from firmloop.verify.reference import element_type, run, set_parameter
from firmloop.verify.run import verify
from firmloop.verify.stimuli.stimuli import stimuli
from tests.laws import FULL, pid
from tests.pid_formula import pid_steps
from tests.quantize.test_lower import leaves_bounds

GAINS = {"kp": [0.0, 0.2], "ki": [0.0, 5.0], "kd": [0.0, 0.001], "b": [0.0, 1.0], "c": [0.0, 1.0]}
LIMITS = {"u_min": [-12.0, -2.0], "u_max": [1.0, 12.0]}
RANGES = {**GAINS, **LIMITS}
VARIANTS: list[dict[str, Any]] = [
    {},
    {"anti_windup": "clamping"},
    {"anti_windup": "none"},
    {"form": "tustin"},
    {"rate_limit_per_s": 2000.0},
]
TUNABLE = {**FULL, "tunable": list(RANGES), "ranges": RANGES}
PROJECT = """\
schema = 1
name = "wheel_speed"
[controller]
kind = "pid"
period_s = 0.001
kp = 0.05
ki = 1.4
tunable = ["kp", "ki"]
[controller.ranges]
kp = [0.0, 0.2]
ki = [0.0, 5.0]
[signals]
reference = { unit = "rad/s", low = -400, high = 400 }
measurement = { unit = "rad/s", low = -400, high = 400 }
output = { unit = "V", low = -12, high = 12 }
[arithmetic]
number = "fixed"
bits = 16
[target]
names = ["host"]
"""


def project(folder: Path, text: str = PROJECT) -> Path:
    path = folder / "wheel_speed.toml"
    path.write_text(text)
    return path


@pytest.mark.parametrize("arithmetic", ARITHMETICS)
def test_every_value_and_change_keeps_bounds_and_agrees(arithmetic: str) -> None:
    law = pid(TUNABLE)
    program = lower(law, arithmetic)
    blocks = stimuli(program, [], 12_000, 3)
    asked = [block.settings for block in blocks]
    for j, value in enumerate(program.parameters):
        seen = np.concatenate([part[..., j].ravel() for part in asked if part is not None]).astype(float)
        changes = sum(np.count_nonzero(part[:, 1:, j] != part[:, :-1, j]) for part in asked if part is not None)
        assert {value.low, value.high} <= set(seen) and np.nanmin(seen) < value.low and changes > 30
    assert leaves_bounds(program, blocks) == []
    traces = run_blocks(program, blocks)
    (rounded,) = measure_rounding(law, program, blocks, traces)
    assert rounded.worst <= rounded.bound < 0.05
    link = LibraryLink(build_host(emit(program, "firmloop generate test.toml"), load_target("host")), program)
    done = compare(program, link, blocks, traces, lambda fraction, label: None)
    assert (done.steps, done.differences) == (12_000, 0)


@pytest.mark.parametrize("arithmetic", ARITHMETICS)
def test_the_setter_takes_its_range_and_nothing_else(arithmetic: str) -> None:
    program = lower(pid(TUNABLE), arithmetic)
    library = ctypes.CDLL(str(build_host(emit(program, "x"), load_target("host"))))
    kind = {"float32": ctypes.c_float, "float64": ctypes.c_double}.get(arithmetic, ctypes.c_int32)
    memory = ctypes.create_string_buffer(library.host_state_bytes())
    for j, value in enumerate(program.parameters):
        setter = getattr(library, f"motor_pid_set_{value.name}")
        setter.argtypes, setter.restype = [ctypes.c_void_p, kind], ctypes.c_bool
        size = ctypes.sizeof(kind)
        place = len(memory) - size * (len(program.parameters) - j)
        tries: list[Any] = [value.low, value.high, (value.low + value.high) / 2, value.low - 1, value.high + 1]
        tries += [] if kind is ctypes.c_int32 else [float("nan"), float("inf"), np.nextafter(np.float32(value.high), 2)]
        for x in tries:
            library.host_init(memory)
            element = element_type(value.number)
            before = np.frombuffer(memory, dtype=element, count=1, offset=place)[0].copy()
            asked = np.array([x]).astype(element)
            taken = setter(memory, kind(asked[0].item()))
            after = np.frombuffer(memory, dtype=element, count=1, offset=place)[0]
            assert after == set_parameter(value, before, asked)[0]
            assert taken == (value.low <= asked[0] <= value.high)


@pytest.mark.parametrize("form", ["default", "tustin"])
def test_a_set_parameter_acts_as_one_that_was_always_there(form: str) -> None:
    program = lower(pid({**TUNABLE, "form": form}), "float64")
    random = np.random.default_rng(1)
    for _ in range(5):
        values = {name: random.uniform(low, high) for name, (low, high) in RANGES.items()}
        rows = np.cumsum(random.normal(size=(400, 2)), axis=0)
        settings = np.broadcast_to(np.array(list(values.values())), (1, 400, len(RANGES)))
        got = run(program, rows[None], settings).outputs[0, :, 0]
        table = {**FULL, **values, "form": form}
        expected = np.array([u for _, u in pid_steps(table, 0.001, rows, pid(FULL).outputs[0])])
        assert np.max(np.abs(got - expected)) < 1e-9 and np.any(np.abs(expected) < 11.9)


@pytest.mark.parametrize("arithmetic", ARITHMETICS)
@pytest.mark.parametrize("variant", VARIANTS)
def test_limits_that_move_are_kept_at_once_and_proven(variant: dict[str, Any], arithmetic: str) -> None:
    if variant == {"anti_windup": "none"} and arithmetic.startswith("fixed"):
        return  # its integral has no bound
    law = pid({**FULL, **variant, "tunable": list(LIMITS), "ranges": LIMITS})
    program = lower(law, arithmetic)
    blocks = stimuli(program, [], 6_000, 4)
    assert leaves_bounds(program, blocks) == []
    check_proof(json.loads(json.dumps(proof(program, law.reasons))))
    grid = 2.0 ** -program.outputs[0].number.fraction if arithmetic.startswith("fixed") else 0.0
    for block, trace in zip(blocks, run_blocks(program, blocks), strict=True):
        low, high = (
            trace.state[..., k].astype(float) * 2.0 ** -program.state[k].number.fraction
            for k in (len(program.state) - 2, len(program.state) - 1)
        )
        out = trace.outputs[..., 0].astype(float) * (grid or 1.0)
        told = trace.status >> 1 & 1 == 1 if not grid else np.zeros(out.shape, bool)
        assert np.all(told | ((out >= low - grid / 2) & (out <= high + grid / 2))), block.name
    library = build_host(emit(program, "firmloop generate test.toml"), load_target("host"))
    traces = run_blocks(program, blocks)
    done = compare(program, LibraryLink(library, program), blocks, traces, lambda fraction, label: None)
    assert (done.steps, done.differences) == (6_000, 0)


@pytest.mark.parametrize("variant", VARIANTS)
def test_set_limits_act_as_ones_that_were_always_there(variant: dict[str, Any]) -> None:
    given = {**FULL, **variant}
    program = lower(pid({**given, "tunable": list(LIMITS), "ranges": LIMITS}), "float64")
    rows = np.cumsum(np.random.default_rng(2).normal(size=(400, 2)), axis=0) * 5
    for low, high in ((-12.0, 12.0), (-2.0, 1.0), (-3.5, 10.0)):
        settings = np.broadcast_to(np.array([low, high]), (1, 400, 2))
        got = run(program, rows[None], settings).outputs[0, :, 0]
        expected = [u for _, u in pid_steps({**given, "u_min": low, "u_max": high}, 0.001, rows, pid(FULL).outputs[0])]
        assert np.max(np.abs(got - np.array(expected))) < 1e-9 and {low, high} & set(got)


def test_the_proof_covers_the_whole_range() -> None:
    law = pid({**FULL, "tunable": ["kp", "ki"], "ranges": {"kp": [0.0, 0.2], "ki": [0.0, 5.0]}})
    program = lower(law, "fixed32")
    document = json.loads(json.dumps(proof(program, law.reasons)))
    checked = check_proof(document)
    assert checked is not None and checked.operations == len(program.body)
    held = next(value for value in document["state"] if value["name"] == "kp")
    assert (held["low"] * 2.0 ** -held["fraction"], held["high"] * 2.0 ** -held["fraction"]) == (
        0.0,
        pytest.approx(0.2, abs=1e-9),
    )


def test_verify_of_a_tunable_project_agrees_and_lists_its_parameters(tmp_path: Path) -> None:
    out = tmp_path / "out"
    assert main(["verify", str(project(tmp_path)), "--out", str(out), "--steps", "4000"]) == 0
    verdict, manifest = (json.loads((out / f"{name}.json").read_text()) for name in ("verdict", "manifest"))
    assert verdict["verdict"] == "agrees" and verdict["steps"] == 4_000
    kp, ki = manifest["parameters"]
    assert (kp["setter"], ki["setter"]) == ("wheel_speed_set_kp", "wheel_speed_set_ki")
    assert (kp["low"], kp["high"], kp["default"]) == (0.0, pytest.approx(0.2), pytest.approx(0.05))
    folder = out / "wheel_speed"
    assert (folder / "test" / "vectors.csv").read_text().splitlines()[
        0
    ] == "start,reference,measurement,kp,ki,output,status"
    run_compiler(["gcc", *FLAGS, "-o", "vectors", "-Isrc", "src/wheel_speed.c", "test/wheel_speed_test.c"], folder)
    done = subprocess.run([str(folder / "vectors")], capture_output=True, text=True, check=False)
    assert done.returncode == 0 and "steps agree" in done.stdout


@pytest.mark.qemu
@pytest.mark.parametrize("arithmetic", ["float32", "fixed16"])
def test_a_tunable_controller_agrees_on_the_m4f(arithmetic: str) -> None:
    law = pid(TUNABLE)
    program = lower(law, arithmetic)
    bundle = emit(program, "firmloop generate motor_pid.toml")
    target = load_target("qemu_mps2_an386")
    verdict = verify(law, program, bundle, target, (), 3_000, 1, None, lambda fraction, label: None)
    assert (verdict.steps, verdict.differences) == (3_000, 0)


@pytest.mark.parametrize(
    ("line", "instead", "words"),
    [
        ('["kp", "ki"]', '["kp", "kq"]', "names 'kq'"),
        ('["kp", "ki"]', '"kp"', "not a list"),
        ('["kp", "ki"]', '["kp"]', "controller.ranges.ki is the range of nothing"),
        ('["kp", "ki"]', '["kp", "ki", "kp"]', "twice"),
        ("kp = [0.0, 0.2]\n", "", "controller.ranges.kp is missing"),
        ("kp = [0.0, 0.2]", "kp = [0.0, inf]", "controller.ranges.kp = inf is not finite"),
        ("kp = [0.0, 0.2]", "kp = [0.2, 0.0]", "not a range"),
        ("kp = [0.0, 0.2]", "kp = [0.1, 0.2]", "does not hold the value at the start, 0.05"),
        ("kp = [0.0, 0.2]", "kp = [0.0, 1e30]", "too large for fixed point"),
        ('["kp", "ki"]', '["kp", "ki", "u_max"]', "u_max = [6.0, 12.0] }"),
        (
            '"ki"]\n[controller.ranges]',
            '"ki", "u_max"]\n[controller.ranges]\nu_max = [6.0, 13.0]',
            "leaves signals.output",
        ),
        (
            '"ki"]\n[controller.ranges]',
            '"ki", "u_max"]\n[controller.ranges]\nu_max = [-12.0, 12.0]',
            "separate the two",
        ),
        ("ki = 1.4", "ki = 0.0", "controller.tt_s is missing"),
        ('kind = "pid"', 'kind = "pid"\nform = "ideal"\nti_s = 1.0', "controller.ki has no place"),
        ('kind = "pid"', 'kind = "notch"', "controller"),
    ],
)
def test_a_wrong_parameter_table_is_refused_in_one_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], line: str, instead: str, words: str
) -> None:
    assert line in PROJECT
    path = project(tmp_path, PROJECT.replace(line, instead, 1))
    assert main(["generate", str(path), "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err.strip()
    assert words in said and "Traceback" not in said and "internal" not in said


def test_the_ranges_that_a_message_proposes_can_be_pasted(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bare = re.sub(r"\[controller\.ranges\]\n(\w+ = .*\n)+", "", PROJECT)
    bare = bare.replace('["kp", "ki"]', '["kp", "ki", "kd", "c", "u_min", "u_max"]\ntf_s = 0.1')
    path = project(tmp_path, bare)
    assert main(["generate", str(path), "--out", str(tmp_path / "out")]) == 2
    proposed = re.search(r"ranges = \{.*\}", capsys.readouterr().err)
    assert proposed is not None
    path.write_text(bare.replace("tunable = ", f"{proposed.group()}\ntunable = "))
    assert main(["generate", str(path), "--out", str(tmp_path / "out")]) == 0, capsys.readouterr().err

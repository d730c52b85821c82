"""No shift is as wide as its word: operations refuse it, and laws at any scale need none or are refused."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, reject, settings
from hypothesis import strategies as st

from bench.proofs.wide_scales import FORMATS, Format, faults_of, wide_draws, wide_shifts
from firmloop.cli import main
from firmloop.codegen.emit import emit
from firmloop.design.kinds import design
from firmloop.design.law import DesignError
from firmloop.identify.signal import Signal
from firmloop.quantize.lower.lower import lower
from firmloop.quantize.ops import EVERY, OPERATIONS, shift_right
from firmloop.quantize.program import Number, Op, Program, QuantizeError, Table, Value
from firmloop.quantize.shifts import COUNTS
from firmloop.verify.reference import run
from firmloop.verify.stimuli.stimuli import stimuli

WORD = Value("x", "", Number("fixed", 32, 0), -1, 1)
PROJECT = """schema = 1
name = "{name}"
[controller]
kind = "pid"
period_s = 0.001
{gains}
anti_windup = "clamping"
[signals]
reference = {{ unit = "rad/s", low = -{span}, high = {span} }}
measurement = {{ unit = "rad/s", low = -{span}, high = {span} }}
output = {{ unit = "V", low = -{limit}, high = {limit} }}
[arithmetic]
number = "fixed"
bits = 32
[target]
names = ["host"]
"""


def shift(function: str, count: int | str) -> Op:
    arguments: list[str | int] = ["a"] * COUNTS[function][0]
    return Op(WORD, function, (*arguments, count))


@pytest.mark.parametrize("function", sorted(COUNTS))
def test_an_operation_refuses_a_count_out_of_its_word(function: str) -> None:
    _, least, most = COUNTS[function]
    assert most < (32 if function in ("shl", "shr", "asr", "wrap") else 64)
    shift(function, least), shift(function, most)
    for count in (least - 1, most + 1, 64, -1, "a"):
        with pytest.raises(QuantizeError, match=f"x: {function} shifts by {least} to {most} places, not by {count}"):
            shift(function, count)


def test_every_operation_that_takes_a_count_is_in_the_list() -> None:
    assert set(COUNTS) == {name for name, operation in EVERY.items() if operation.whole and name in OPERATIONS}


@pytest.mark.parametrize("count", [-3, 0, 63, 64])
def test_a_table_refuses_a_count_out_of_its_word(count: int) -> None:
    with pytest.raises(QuantizeError, match=f"plan: a table shifts by 1 to 62 places, not by FL_SHIFT_LAW = {count}"):
        Table("plan", "", "fl_tree_t", "fl_tree_i32.h", (("FL_SHIFT_LAW", count),), ())


@given(st.integers(-(2**63), 2**63 - 1), st.integers(1, 62))
def test_rounding_to_nearest_overflows_nowhere_in_64_bits(total: int, count: int) -> None:
    assert int(shift_right(np.int64(total), count)) == (total + 2 ** (count - 1)) // 2**count


def test_the_search_for_wide_shifts_finds_them() -> None:
    wide = ("fl_asr_i32(t4, 32U)", "fl_high_i32(t1, 64U)", "FL_SHIFT_LAW = -1")
    assert wide_shifts("\n".join((*wide, "fl_asr_i32(in->a, 31U)", "fl_mul_shift_i32(t, 3, 62U)"))) == list(wide)


def test_an_integrator_that_no_error_can_move_is_refused_by_name(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "still.toml"
    file.write_text(PROJECT.format(name="still", gains="kp = 0.04\nki = 0.009", span=0.002, limit=9000.0))
    assert main(["generate", str(file), "--out", str(tmp_path / "out")]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "for output, integral: a value of at most 7.03e-08 is nothing in units of 1.53e-05" in line
    assert "narrow the wide ranges in [signals]" in line and len(line) < 500
    assert not (tmp_path / "out").exists()


def tuned(rounds: str = "nearest") -> Program:
    """Return a PI whose integral is moved by less than one unit, and its output by a trapezoid of a third of one."""
    wires = tuple(Signal(name, "rad/s", -0.1, 0.1) for name in ("reference", "measurement"))
    table = {"kp": 0.005, "anti_windup": "clamping", "form": "tustin", "tunable": ["kp", "ki"]}
    table |= {"ranges": {"kp": [0.0, 0.0393], "ki": [0.0, 0.0119]}}
    law = design("pid", "tuned", table, 0.001, wires, (Signal("output", "V", -2000.0, 2054.0),), None).law
    assert faults_of(law, lower(law, "fixed32", rounds)) == []
    return lower(law, "fixed32", rounds)


@pytest.mark.parametrize("rounds", ["nearest", "floor"])
def test_what_vanishes_beside_others_is_left_out_within_the_bound(rounds: str) -> None:
    program = tuned(rounds)
    used = {argument for op in program.body for argument in op.arguments}
    ends = {a.source for a in (*program.next_state, *program.results)} | {b.source for b in program.status}
    assert {op.result.name for op in program.body} <= used | ends, "computed for nothing"
    assert not wide_shifts(emit(program, "firmloop generate").files["tuned.c"])


def test_an_integrator_of_less_than_a_unit_falls_no_more_than_it_rises() -> None:
    program = tuned()
    steps = [op.result for op in program.body if op.function == "mul_shift" and op.arguments[1] == 1]
    assert steps and all((value.low, value.high) == (-1, 1) for value in steps)


SCALE = st.floats(-6.0, 6.0).map(lambda decade: 10.0**decade)
SHARE = st.floats(-4.0, 1.0).map(lambda decade: 10.0**decade)


@st.composite
def pids(draw: st.DrawFn) -> tuple[dict[str, object], float, float]:
    """Draw a PID over twelve decades of signals and limits, its gain over eleven beside these."""
    span, limit = draw(SCALE), draw(SCALE)
    kp = 10.0 ** draw(st.floats(-10.0, 1.0)) * limit / span  # from where nothing is left of the error's effect
    table: dict[str, object] = {"kp": kp, "ki": kp * draw(SHARE) * 10}
    if draw(st.booleans()):
        table |= {"kd": kp * draw(SHARE) * 0.01, "tf_s": 0.001 + draw(SHARE)}
    table["anti_windup"] = draw(st.sampled_from(["back_calculation", "clamping"]))
    table["form"] = draw(st.sampled_from(["default", "tustin"]))
    if draw(st.booleans()):
        names = [name for name in ("kp", "ki", "kd") if name in table]
        chosen = draw(st.lists(st.sampled_from(names), min_size=1, unique=True))
        table |= {"tunable": chosen, "ranges": {n: [0.0, float(str(table[n])) * draw(st.floats(1, 9))] for n in chosen}}
    return table, span, limit


@settings(max_examples=200, suppress_health_check=[HealthCheck.filter_too_much])
@given(pids(), st.sampled_from(FORMATS))
def test_a_pid_at_any_scale_has_no_wide_shift_and_keeps_its_ranges(
    drawn: tuple[dict[str, object], float, float], form: Format
) -> None:
    table, span, limit = drawn
    wires = tuple(Signal(name, "rad/s", -span, span) for name in ("reference", "measurement"))
    try:
        law = design("pid", "scaled", table, 0.001, wires, (Signal("output", "V", -limit, limit),), None).law
        program = lower(law, form.arithmetic, form.rounds)
    except (DesignError, QuantizeError):
        reject()
    assert not wide_shifts("\n".join(emit(program, "firmloop generate").files.values()))
    block = stimuli(program, [], 200, 1)[0]
    trace = run(program, block.inputs, block.settings)
    for j, value in enumerate(program.outputs):
        assert value.low <= trace.outputs[..., j].min() and trace.outputs[..., j].max() <= value.high


def test_laws_of_every_kind_at_any_scale_agree_with_their_c() -> None:
    seen = set()
    for k, draw in enumerate(itertools.islice(wide_draws(5), 27)):
        if draw.law is None:
            continue
        form = FORMATS[k % len(FORMATS)]
        try:
            program = lower(draw.law, form.arithmetic, form.rounds)
        except QuantizeError:
            continue
        seen.add(draw.kind)
        assert faults_of(draw.law, program) == [], (k, draw.kind, form)
    assert len(seen) >= 4

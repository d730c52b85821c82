"""A Program keeps its proven bounds and stays within its printed distance of the law."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from firmloop.codegen.emit import emit
from firmloop.codegen.target import load_target
from firmloop.design.kinds import kinds
from firmloop.design.law import Flag, Law, Scalar
from firmloop.identify.signal import Signal
from firmloop.quantize.lower.lower import ARITHMETICS, lower
from firmloop.quantize.program import Program, QuantizeError, Value
from firmloop.verify.block import Block, run_blocks
from firmloop.verify.build.host import build_host
from firmloop.verify.compare import compare
from firmloop.verify.links.library import LibraryLink
from firmloop.verify.proofs.rounding import measure_rounding
from firmloop.verify.reference import Machine, run, set_parameter, start_state, working_type
from firmloop.verify.stimuli.stimuli import stimuli
from tests.laws import FULL, SPEED, TABLES, VOLTS, pid, random_law


def leaves_bounds(program: Program, blocks: list[Block]) -> list[str]:
    """Run the blocks and name every value that leaves its proven bounds."""
    machine = Machine(program)
    length = max(b.inputs.shape[1] for b in blocks)
    inputs = np.concatenate([b.inputs for b in blocks if b.inputs.shape[1] == length])
    asked = [b.settings for b in blocks if b.inputs.shape[1] == length and b.settings is not None]
    settings = np.concatenate(asked).astype(working_type(program)) if asked else None
    if program.arithmetic.startswith("float"):  # a float's bounds hold while its inputs keep their ranges
        calm = [all(_calm(program, lane)) for lane in inputs]
        inputs, settings = inputs[calm], None if settings is None else settings[calm]
    if not program.state:  # no step knows of another: all at once
        inputs = inputs.reshape(-1, 1, inputs.shape[2])
    first = len(program.state) - len(program.tunable)
    lanes, steps, _ = inputs.shape
    state = start_state(program, lanes)
    wrong: set[str] = set()
    with np.errstate(all="ignore"):
        for k in range(steps):
            row = [inputs[:, k, j].astype(working_type(program)) for j in range(len(program.inputs))]
            for j, value in enumerate(program.parameters if settings is not None else ()):
                state[first + j] = set_parameter(value, state[first + j], settings[:, k, j])
            if k % 4:  # every fourth step is enough: lanes are many
                state = machine.after(row, state)
                continue
            values = machine.step(row, state)
            state = machine.following(values, lanes)
            named = machine.named(values)
            checked = [(op.result, named[op.result.name]) for op in program.body]
            wrong |= _outside([*checked, *zip(program.state, state, strict=True)])
    return sorted(wrong)


def _outside(checked: list[tuple[Value, np.ndarray]]) -> set[str]:
    """Return the names of the values that are beyond their bounds in a lane; those of a kind are looked at at once."""
    alike: dict[tuple[object, ...], list[tuple[Value, np.ndarray]]] = {}
    for value, got in checked:
        row = np.asarray(got)
        alike.setdefault((row.dtype, row.shape), []).append((value, row))
    wrong = set()
    for group in alike.values():
        rows = np.array([row for _, row in group]).reshape(len(group), -1)
        for (value, _), least, most in zip(group, rows.min(axis=1), rows.max(axis=1), strict=True):
            if least < value.low or most > value.high:
                wrong.add(value.name)
    return wrong


def _calm(program: Program, lane: np.ndarray) -> list[bool]:
    ends = [(v.low, v.high) for v in program.inputs]
    return [bool(np.all((lane[:, j] >= low) & (lane[:, j] <= high))) for j, (low, high) in enumerate(ends)]


@pytest.mark.parametrize("arithmetic", ARITHMETICS)
@pytest.mark.parametrize("table", sorted(TABLES))
def test_pid_keeps_bounds_and_distance(table: str, arithmetic: str) -> None:
    law = pid(TABLES[table])
    program = lower(law, arithmetic)
    blocks = stimuli(program, [], 20_000, 5)
    assert leaves_bounds(program, blocks) == []
    (rounded,) = measure_rounding(law, program, blocks, run_blocks(program, blocks))
    assert rounded.worst <= rounded.bound
    assert np.isfinite(rounded.bound) and rounded.bound < 0.05


@pytest.mark.parametrize("arithmetic", ARITHMETICS)
def test_random_laws_keep_bounds_and_distance(arithmetic: str) -> None:
    for seed in range(10):
        law = random_law(np.random.default_rng(seed))
        program = lower(law, arithmetic)
        blocks = stimuli(program, [], 300, seed)
        assert leaves_bounds(program, blocks) == [], seed
        for rounded in measure_rounding(law, program, blocks, run_blocks(program, blocks)):
            assert rounded.worst <= rounded.bound, seed


@pytest.mark.parametrize("arithmetic", ["fixed32", "fixed16"])
def test_fixed_formats_are_words_of_their_width(arithmetic: str) -> None:
    program = lower(pid(FULL), arithmetic)
    bits = int(arithmetic[5:])
    for value in (*program.inputs, *program.outputs):
        assert value.number.bits == bits
        assert -(2 ** (bits - 1)) <= value.low < value.high < 2 ** (bits - 1)
    for op in program.body:
        half = 2 ** (63 if op.function in ("wide", "mac") else 31)
        assert -half <= op.result.low <= op.result.high < half


@pytest.mark.parametrize("arithmetic", ["fixed32", "fixed16"])
def test_unbounded_state_is_refused_in_fixed_point(arithmetic: str) -> None:
    with pytest.raises(QuantizeError, match=r"integral has no finite proven range.*float32"):
        lower(pid({**FULL, "anti_windup": "none"}), arithmetic)
    lower(pid({**FULL, "anti_windup": "none"}), "float32")


def test_coefficients_beyond_the_word_are_refused() -> None:
    law = pid({"kp": 1e-25})
    with pytest.raises(QuantizeError, match="1e-25 cannot be held"):
        lower(law, "fixed32")


def test_ranges_beyond_the_word_are_refused() -> None:
    wide = tuple(Signal(s.name, s.unit, -1e15, 1e15) for s in SPEED)
    law = replace(pid({"kp": 0.05}), inputs=wide)
    with pytest.raises(QuantizeError, match="range of a signal or a gain is too large"):
        lower(law, "fixed32")


def test_unknown_arithmetic_is_named() -> None:
    with pytest.raises(QuantizeError, match="fixed8"):
        lower(pid(FULL), "fixed8")


def test_program_id_depends_on_every_gain_and_range() -> None:
    base = lower(pid(FULL), "fixed32").id
    assert base == lower(pid(FULL), "fixed32").id
    assert base != lower(pid({**FULL, "kp": 0.0500001}), "fixed32").id
    assert base != lower(replace(pid(FULL), outputs=(replace(VOLTS[0], unit="A"),)), "fixed32").id


@pytest.mark.parametrize("arithmetic", ARITHMETICS)
def test_limits_are_never_exceeded_even_by_a_rounding(arithmetic: str) -> None:
    program = lower(pid(TABLES["narrow"]), arithmetic)
    scale = 2.0 ** -program.outputs[0].number.fraction
    for block in stimuli(program, [], 30_000, 6):
        got = run(program, block.inputs).outputs.astype(float) * scale
        assert got.min() >= -3.3 and got.max() <= 11.7


@pytest.mark.parametrize("arithmetic", ARITHMETICS)
def test_a_state_that_takes_anothers_old_value_takes_it_before_that_is_written(arithmetic: str) -> None:
    x, z = ca.SX.sym("x", 3), ca.SX.sym("z", 1)
    stage = ca.Function("law", [x, z], [ca.vertcat(z, x[0], x[1]), x[2], z > 0.5, ca.SX(0, 1)])
    law = Law(
        name="delay",
        says="three samples late",
        period=0.01,
        inputs=(Signal("now", "V", -1.0, 1.0),),
        outputs=(Signal("late", "V", -1.0, 1.0),),
        state=tuple(Signal(f"past_{k}", "V", -1.0, 1.0) for k in (1, 2, 3)),
        start=(0.0, 0.0, 0.0),
        why=("an input of before",) * 3,
        flags=(Flag("much", "more than half a volt now"),),
        stages=(Scalar(stage, ()),),
    )
    program = lower(law, arithmetic)
    blocks = stimuli(program, [], 2_000, 5)
    traces = run_blocks(program, blocks)
    library = LibraryLink(build_host(emit(program, "firmloop generate x.toml"), load_target("host")), program)
    done = compare(program, library, blocks, traces, lambda part, label: None)
    assert (done.steps, done.differences) == (2_000, 0)


def test_a_pid_of_16_bits_multiplies_inputs_as_they_are() -> None:
    body = lower(pid(FULL), "fixed16").body
    assert not [op for op in body if op.result.name.endswith("_wide")]
    taken = [op.arguments[1] for op in body if op.function == "mul_add_short"]
    assert taken == ["in.reference", "in.reference", "in.measurement"]


def test_an_input_of_16_bits_that_is_widened_for_one_operation_is_widened_for_all() -> None:
    kind = kinds()["state_space"]
    body = lower(kind.design(kind.example).law, "fixed16").body
    wide = {op.result.name for op in body if op.result.name.endswith("_wide")}
    assert "measurement_wide" in wide  # of a sum of five products
    assert not [op for op in body if op.function == "mul_add_short" and f"{str(op.arguments[1])[3:]}_wide" in wide]


def test_the_opposite_of_a_difference_is_no_second_difference() -> None:
    kind = kinds()["lead_lag"]
    body = lower(kind.design(kind.example).law, "fixed16").body
    assert len([op for op in body if op.function == "sub"]) == 1

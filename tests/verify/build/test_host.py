"""The generated C agrees with the reference on the host, in every format, in every bit."""

from dataclasses import replace

import numpy as np
import pytest

from firmloop.codegen.emit import emit
from firmloop.codegen.target import load_target
from firmloop.quantize.lower.lower import ARITHMETICS, lower
from firmloop.verify.block import run_blocks
from firmloop.verify.build.host import build_host
from firmloop.verify.build.sanitized import Sanitized, compare_sanitized, run_sanitized
from firmloop.verify.compare import Comparison, compare
from firmloop.verify.explain import explain
from firmloop.verify.links.library import LibraryLink
from firmloop.verify.stimuli.stimuli import stimuli
from firmloop.verify.stimuli.stimulus import LANE_STEPS
from tests.laws import FULL, TABLES, pid, random_law

HOST = load_target("host")


def quiet(fraction: float, label: str) -> None:
    del fraction, label


def agreement(law: object, arithmetic: str, steps: int) -> Comparison:
    program = lower(law, arithmetic)  # type: ignore[arg-type]
    bundle = emit(program, "firmloop generate test.toml")
    blocks = stimuli(program, [], steps, 1)
    link = LibraryLink(build_host(bundle, HOST), program)
    return compare(program, link, blocks, run_blocks(program, blocks), quiet)


@pytest.mark.parametrize("arithmetic", ARITHMETICS)
def test_a_million_steps_agree(arithmetic: str) -> None:
    done = agreement(pid(FULL), arithmetic, 1_000_000)
    assert (done.steps, done.differences) == (1_000_000, 0)


@pytest.mark.parametrize("arithmetic", ARITHMETICS)
@pytest.mark.parametrize("table", sorted(set(TABLES) - {"full"}))
def test_every_form_agrees(table: str, arithmetic: str) -> None:
    done = agreement(pid(TABLES[table]), arithmetic, 40_000)
    assert (done.steps, done.differences) == (40_000, 0)


@pytest.mark.parametrize("arithmetic", ARITHMETICS)
def test_random_laws_agree(arithmetic: str) -> None:
    for seed in range(6):
        assert agreement(random_law(np.random.default_rng(seed)), arithmetic, 5_000).differences == 0, seed


@pytest.mark.parametrize("arithmetic", ARITHMETICS)
def test_sanitizers_find_nothing(arithmetic: str) -> None:
    program = lower(pid(FULL), arithmetic)
    blocks = stimuli(program, [], 40_000, 2)
    bundle = emit(program, "firmloop generate test.toml")
    done = compare_sanitized(program, bundle, run_sanitized(program, bundle, blocks), run_blocks(program, blocks))
    assert done == Sanitized(40_000, 0, None, None, "")


def test_a_difference_is_explained_down_to_the_operation() -> None:
    program = lower(pid(FULL), "fixed32")
    bundle = emit(program, "firmloop generate test.toml")
    source = bundle.files["motor_pid.c"]
    good = next(line for line in source.splitlines() if "const int32_t unlimited = " in line)
    bad = good.replace(" + ", " - ", 1)
    assert bad != good
    wrong = replace(bundle, files={**bundle.files, "motor_pid.c": source.replace(good, bad)})
    blocks = stimuli(program, [], 20_000, 1)
    link = LibraryLink(build_host(wrong, HOST), program)
    done = compare(program, link, blocks, run_blocks(program, blocks), quiet)
    assert done.first is not None and done.differences > 0
    lane = blocks[done.first.block].inputs[done.first.lane]
    words = explain(program, wrong, lane, done.first.step, done.first.output)
    assert "unlimited = integral_held + " in words and "should be" in words


def test_a_difference_that_the_text_does_not_hold_is_told_apart() -> None:
    program = lower(pid(FULL), "fixed32")
    bundle = emit(program, "firmloop generate test.toml")
    block = stimuli(program, [], 5_000, 1)[0]
    assert "compiler" in explain(program, bundle, block.inputs[0], 50, "output")


@pytest.mark.parametrize("arithmetic", ARITHMETICS)
def test_two_instances_do_not_touch_and_init_starts_over(arithmetic: str) -> None:
    program = lower(pid(FULL), arithmetic)
    library = build_host(emit(program, "firmloop generate test.toml"), HOST)
    first, second = LibraryLink(library, program), LibraryLink(library, program)
    block = stimuli(program, [], 20 * LANE_STEPS, 3)[0]
    lanes = [np.ascontiguousarray(x) for x in block.inputs[:2]]
    size = lanes[0].itemsize * lanes[0].shape[1]
    alone = []
    for link, lane in zip((first, second), lanes, strict=True):
        link.reset()
        alone.append(link.step(lane.tobytes(), len(lane)))
    first.reset()
    second.reset()
    mixed: list[list[bytes]] = [[], []]
    for k in range(len(lanes[0])):
        for i, link in enumerate((first, second)):
            mixed[i].append(link.step(lanes[i].tobytes()[k * size : (k + 1) * size], 1))
    assert [b"".join(m) for m in mixed] == alone


def test_stimuli_hold_exactly_the_steps_asked_for() -> None:
    program = lower(pid(FULL), "fixed16")
    for steps in (1, 7, 999, 1000, 12_345, 200_001):
        blocks = stimuli(program, [], steps, 1)
        assert sum(b.inputs.shape[0] * b.inputs.shape[1] for b in blocks) == steps


def test_recorded_signals_are_used_and_missing_inputs_filled() -> None:
    program = lower(pid(FULL), "float32")
    blocks = stimuli(program, [{"measurement": np.linspace(0, 500, 700)}], 100, 1)
    recorded = blocks[-1]
    assert recorded.name == "recorded" and recorded.inputs.shape == (1, 700, 2)
    assert recorded.inputs[0, -1, 1] == np.float32(400.0)  # limited to the signal's range


def test_library_link_refuses_a_wrong_size() -> None:
    program = lower(pid(FULL), "fixed16")
    link = LibraryLink(build_host(emit(program, "x"), HOST), program)
    with pytest.raises(Exception, match="need 8 bytes"):
        link.step(b"\0" * 7, 2)

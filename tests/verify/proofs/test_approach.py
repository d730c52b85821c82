"""Limits that a controller reaches only after many samples are met to the last bit, from either side."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from firmloop.design.kinds import kinds
from firmloop.quantize.lower.lower import lower
from firmloop.verify.reference import Machine, run, start_state
from firmloop.verify.stimuli.approach import approaches, crossings
from firmloop.verify.stimuli.edges import Edge, edges, limits, nearest
from firmloop.verify.stimuli.stimuli import stimuli

DRIVES = np.where(np.arange(4)[:, None, None] % 2 == 0, 1.0, -1.0) * np.array([12.0, -2.0]) * np.ones((4, 40, 2))


@pytest.mark.parametrize("arithmetic", ["float32", "fixed32", "fixed16"])
def test_a_state_is_brought_to_a_limit_next_to_it_and_beyond(arithmetic: str) -> None:
    kind = kinds()["sensorless_speed"]
    program = lower(kind.design(kind.example).law, arithmetic)
    fraction = program.state[1].number.fraction
    late = [c for c in crossings(program, DRIVES) if c.edge.value.startswith("speed_model") and c.at > 2]
    assert late, "an observer does not reach 700 rad/s at once"
    lanes = approaches(program, np.random.default_rng(1), DRIVES, 2000)
    assert lanes is not None
    one = 1.0 if arithmetic != "float32" else float(np.spacing(np.float32(700.0)))
    limit = 700.0 * 2.0**fraction
    speed = np.abs(run(program, lanes).state[..., 1].astype(np.float64))
    assert {-one, 0.0, one} <= set(np.unique(speed - limit))


def test_lanes_that_approach_a_limit_from_afar_are_among_the_stimuli() -> None:
    kind = kinds()["sensorless_speed"]
    program = lower(kind.design(kind.example).law, "fixed32")
    blocks = stimuli(program, [], 20_000, 1)
    lanes = next(block.inputs for block in blocks if block.name == "limits from afar")
    speed = np.abs(run(program, lanes).state[..., 1])
    assert np.any(speed == 700 * 2 ** program.state[1].number.fraction)
    assert sum(len(b.inputs) * b.inputs.shape[1] for b in blocks) == 20_000


def test_what_shares_leave_over_is_no_long_lane_of_its_own() -> None:
    kind = kinds()["pid"]
    program = lower(kind.design(kind.example).law, "fixed32")
    blocks = stimuli(program, [], 103_007, 1)
    assert sum(len(b.inputs) * b.inputs.shape[1] for b in blocks) == 103_007
    assert max(b.inputs.shape[1] for b in blocks) == 1000
    assert len({b.inputs.shape[1] for b in blocks}) <= 6


def test_every_edge_is_met_on_it_above_and_below_before_any_twice() -> None:
    which = np.array([0, 0, 0, 0, 1, 1, 1])
    miss = np.array([0.0, 0.0, 0.0, 2.0, -3.0, -1.0, np.inf])
    assert sorted(nearest(which, miss, 3)) == [0, 3, 5]
    assert 6 not in nearest(which, miss, 6)


def test_values_that_are_compared_are_edges_too() -> None:
    kind = kinds()["start_monitor"]
    program = lower(kind.design(kind.example).law, "fixed16")
    compared = {op.arguments for op in program.body if op.function == "lt"}
    found = limits(program)
    assert compared and all(
        any({edge.value, edge.limit} >= {a for a in pair if not str(a).startswith("self.")} for edge in found)
        for pair in compared
    )


def test_short_inputs_bring_a_long_value_next_to_its_limit_and_one_to_where_an_output_rounds() -> None:
    kind = kinds()["sliding_mode"]
    program = lower(kind.design(kind.example).law, "fixed16")
    wanted = limits(program)
    assert [edge.every for edge in wanted if np.isfinite(edge.every)] == [2.0**14]
    lanes = edges(program, np.random.default_rng(1), 400, 3)
    machine, state = Machine(program), start_state(program, len(lanes))
    for k in range(2):
        slots = machine.step(list(lanes[:, k].T.astype(np.int64)), state)
        state = [np.broadcast_to(slots[slot], len(lanes)) for slot in machine.next]
    beyond = next(edge for edge in wanted if edge.value == "unlimited").above(machine, slots)
    assert {-1.0, 0.0} <= set(np.unique(beyond))


def test_how_far_a_value_is_from_where_it_rounds_is_told_from_the_nearest_place() -> None:
    edge = Edge("x", 8.0, 16.0)

    read: Any = SimpleNamespace(slots={"x": 0})
    above = [float(edge.above(read, [np.array(x)])) for x in (7.0, 8.0, 9.0, 23.0, 41.0)]
    assert above == [-1.0, 0.0, 1.0, -1.0, 1.0]

"""Limits that a controller reaches only after many samples are met to the last bit, from either side."""

from __future__ import annotations

import numpy as np
import pytest

from design.kinds import kinds
from quantize.lower import lower
from verify.approach import approaches, crossings
from verify.reference import run
from verify.stimuli import stimuli, to_raw

DRIVES = np.where(np.arange(4)[:, None, None] % 2 == 0, 1.0, -1.0) * np.array([12.0, -2.0]) * np.ones((4, 40, 2))


@pytest.mark.parametrize("arithmetic", ["float32", "fixed32", "fixed16"])
def test_a_state_is_brought_to_a_limit_next_to_it_and_beyond(arithmetic: str) -> None:
    kind = kinds()["sensorless_speed"]
    program = lower(kind.design(kind.example).law, arithmetic)
    fraction = program.state[1].number.fraction
    late = [c for c in crossings(program, DRIVES, to_raw) if c.name.startswith("speed_model") and c.at > 2]
    assert late, "an observer does not reach 700 rad/s at once"
    lanes = approaches(program, np.random.default_rng(1), DRIVES, 2000, to_raw)
    assert lanes is not None
    one = 1.0 if arithmetic != "float32" else float(np.spacing(np.float32(700.0)))
    limit = 700.0 * 2.0**fraction
    speed = np.abs(run(program, lanes).state[..., 1].astype(np.float64))
    assert {-one, 0.0, one} <= set(np.unique(speed - limit))


def test_such_lanes_are_among_the_stimuli() -> None:
    kind = kinds()["sensorless_speed"]
    program = lower(kind.design(kind.example).law, "fixed32")
    blocks = {block.name: block for block in stimuli(program, [], 20_000, 1)}
    speed = np.abs(run(program, blocks["limits from afar"].inputs).state[..., 1])
    assert np.any(speed == 700 * 2 ** program.state[1].number.fraction)
    assert sum(len(b.inputs) * b.inputs.shape[1] for b in stimuli(program, [], 20_000, 1)) == 20_000

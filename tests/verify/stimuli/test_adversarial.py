"""The worst-case inputs reach what was proven, in values and in roundings, and never more."""

from __future__ import annotations

import numpy as np
import pytest

from bench.codegen.bounds import worst
from firmloop.design.design import Kind
from firmloop.design.kinds import kinds
from firmloop.quantize.lower.lower import lower
from firmloop.verify.reference import run
from firmloop.verify.scaling import to_physical
from firmloop.verify.stimuli.stimuli import adversarial, stimuli

LINEAR = [kind for name, kind in kinds().items() if name in ("state_space", "lead_lag", "notch")]


@pytest.mark.parametrize("kind", LINEAR, ids=lambda kind: kind.name)
def test_the_worst_case_drives_every_state_to_the_end_of_its_proven_range(kind: Kind) -> None:
    law = kind.design(kind.example).law
    program = lower(law, "fixed32")
    block = next(block for block in adversarial(program, 60_000, 1) if block.name == "worst case")
    state = run(program, block.inputs).state
    for j, (value, proven) in enumerate(zip(program.state, law.state, strict=True)):
        x = to_physical(value, state[..., j])
        reached = np.array([x.min(), x.max()]) / np.array([proven.low, proven.high])
        assert np.all(reached <= 1.0)
        assert np.all(reached > 0.95), value.name  # it is widened by 1 %


@pytest.mark.parametrize(
    ("name", "arithmetic", "most"),
    [
        ("pid", "fixed32", 3.0),
        ("transfer_function", "float32", 3.0),
    ],
)
def test_the_bound_on_rounding_is_kept_and_close(name: str, arithmetic: str, most: float) -> None:
    kind = kinds()[name]
    for rounded in worst(kind.design(kind.example).law, arithmetic, 8_000):
        assert rounded.worst <= rounded.bound <= most * rounded.worst


def test_every_character_is_among_the_stimuli() -> None:
    kind = kinds()["pid"]
    program = lower(kind.design(kind.example).law, "fixed16")
    blocks = {block.name: block for block in stimuli(program, [], 100_000, 1)}
    assert {"worst case", "squares", "chirps", "long saturation"} <= set(blocks)
    squares = to_physical(program.inputs[0], blocks["squares"].inputs[..., 0])
    assert set(np.round(np.unique(squares))) == {-400.0, 400.0}

"""A chain of sections keeps its places in fixed point, and the answer to any input stays near the transfer function."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.signal

from firmloop.design.kinds import design
from firmloop.quantize.lower.lower import lower
from firmloop.quantize.program import Program
from firmloop.verify.reference import run
from firmloop.verify.scaling import to_physical, to_raw
from tests.laws import SPEED, VOLTS

FILTERS = {
    "butterworth": scipy.signal.butter(6, 0.15),
    "chebyshev near z = 1": scipy.signal.cheby1(4, 1, 0.02),
    "elliptic, zeros on the circle": scipy.signal.ellip(5, 1, 40, 0.3),
    "band pass": scipy.signal.butter(2, [0.05, 0.1], "band"),
    "poles at z = 0 alone": ([0.3, 0.6, 0.9, 0.6], [1.0, 0.0, 0.0, 0.0]),
}


def program_of(name: str) -> Program:
    above, below = FILTERS[name]
    table = {"numerator": [0.03 * float(b) for b in above], "denominator": [float(a) for a in below]}
    return lower(design("transfer_function", "chain", table, 0.001, SPEED, VOLTS, None).law, "fixed32")


@pytest.mark.parametrize("name", FILTERS)
def test_long_runs_stay_near_the_transfer_function(name: str) -> None:
    program, random = program_of(name), np.random.default_rng(1)
    inputs = np.repeat(random.uniform(-400.0, 400.0, size=(8, 30, 2)), 20, axis=1)
    raw = np.stack([to_raw(v, inputs[..., j]) for j, v in enumerate(program.inputs)], axis=-1)
    reference, measurement = (to_physical(v, raw[..., j]) for j, v in enumerate(program.inputs))
    got = to_physical(program.outputs[0], run(program, raw).outputs[..., 0])
    above, below = FILTERS[name]
    exact = np.clip(scipy.signal.lfilter(0.03 * np.asarray(above), below, reference - measurement), -12.0, 12.0)
    assert np.abs(got - exact).max() < 1e-6 * 12.0


@pytest.mark.parametrize("name", FILTERS)
def test_every_value_is_read(name: str) -> None:
    program = program_of(name)
    read = {a for op in program.body for a in op.arguments} | {b.source for b in program.status}
    read |= {store.source for store in (*program.results, *program.next_state)}
    assert [op.result.name for op in program.body if op.result.name not in read] == []

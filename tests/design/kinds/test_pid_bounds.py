"""No input in range drives a PID's state out of its proven range, and the range is not absurdly wide."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from firmloop.design.kinds import design
from firmloop.design.law import Law
from firmloop.identify.signal import Signal

INPUTS = (Signal("reference", "rad/s", -100.0, 400.0), Signal("measurement", "rad/s", -300.0, 350.0))
OUTPUTS = (Signal("output", "V", -12.0, 8.0),)
PERIOD = 0.001


def pid(table: dict[str, object]) -> Law:
    return design("pid", "x", table, PERIOD, INPUTS, OUTPUTS, None).law


def bang_bang(steps: int, longest: float, seed: int) -> np.ndarray:
    """Inputs (steps, 2) that jump and stay for 1 to `longest` samples.

    They jump between the corners of their ranges, both ends of the range they share, where the error is zero, and
    points near these.
    """
    random = np.random.default_rng(seed)
    dwell = np.exp(random.uniform(0, np.log(longest), steps)).astype(int) + 1
    piece = np.repeat(np.arange(steps), dwell)[:steps]
    ends = np.array([[signal.low, signal.high] for signal in INPUTS])
    levels = np.column_stack([ends[k, random.integers(0, 2, steps)] for k in range(2)])
    shared = np.array([ends[:, 0].max(), ends[:, 1].min(), 0.0])[random.integers(0, 3, steps)]
    meets = random.random(steps) < 0.4
    levels[meets] = shared[meets, None]
    levels += random.choice([0.0, 0.01, 0.1], (steps, 1)) * random.uniform(-400, 400, (steps, 2))
    return np.clip(levels, ends[:, 0], ends[:, 1])[piece]


def extremes(law: Law, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    x = np.array(law.last.function.mapaccum(len(rows))(np.array(law.start), rows.T)[0])
    return x.min(axis=1), x.max(axis=1)


@settings(max_examples=14, deadline=None, derandomize=True)
@given(
    kp=st.floats(-1, 1),
    ki=st.sampled_from([0.05, 2.0, 90.0, -3.0]),
    kd=st.sampled_from([0.0, 1e-3, 0.02, -0.005]),
    tf=st.sampled_from([2e-4, 2e-3, 0.05]),
    b=st.sampled_from([0.0, 0.5, 1.0, 1.4]),
    c=st.sampled_from([0.0, 1.0]),
    tt=st.sampled_from([1.0, 1.3, 20.0, 400.0]),
    mode=st.sampled_from(["back_calculation", "back_calculation", "clamping"]),
    form=st.sampled_from(["default", "tustin"]),
    seed=st.integers(0, 2**32 - 1),
)
def test_no_state_leaves_its_range(kp, ki, kd, tf, b, c, tt, mode, form, seed):
    table = {"kp": kp, "ki": ki, "kd": kd, "tf_s": tf, "b": b, "c": c, "tt_s": tt * PERIOD}
    law = pid({**table, "anti_windup": mode, "form": form})
    for longest in (3.0, 50.0, 3000.0):
        low, high = extremes(law, bang_bang(33_334, longest, seed))
        for k, signal in enumerate(law.state):
            assert signal.low <= low[k] and high[k] <= signal.high, signal


@pytest.mark.parametrize("mode", ["back_calculation", "clamping"])
@pytest.mark.parametrize("form", ["default", "tustin"])
@pytest.mark.parametrize(("kd", "loosest"), [(0.0, 1.25), (2e-4, 6.0)])  # the bound lets D stand at its peak for ever
def test_the_range_is_reached_almost(mode, form, kd, loosest):
    table = {"kp": 0.05, "ki": 1.0, "kd": kd, "tf_s": 2e-3, "tt_s": 0.02, "anti_windup": mode, "form": form}
    law = pid(table)
    runs = [extremes(law, bang_bang(50_000, longest, 7)) for longest in (3.0, 30.0, 1000.0)]
    low, high = np.min([low for low, _ in runs], axis=0), np.max([high for _, high in runs], axis=0)
    for k, signal in enumerate(law.state[:2]):
        assert signal.high - signal.low <= loosest * (high[k] - low[k]), (signal, low[k], high[k])


def test_without_anti_windup_there_is_no_bound_and_it_says_so():
    law = pid({"kp": 0.05, "ki": 1.0, "anti_windup": "none"})
    assert law.state[0].low == -np.inf and law.state[0].high == np.inf
    assert "no bound" in law.why[0]

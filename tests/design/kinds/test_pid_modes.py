"""Forms, rate limit, manual, automatic and tracking of the PID: the formulas, the proven ranges, no bump."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from firmloop.design.analysis.loop import margins
from firmloop.design.kinds import design
from firmloop.design.law import DesignError, Law
from firmloop.identify.plants.kinds import make_plant
from firmloop.identify.signal import Signal
from firmloop.identify.simulation.linearize import linearize
from firmloop.quantize.lower.lower import ARITHMETICS, lower
from firmloop.verify.block import run_blocks
from firmloop.verify.proofs.rounding import measure_rounding
from firmloop.verify.stimuli.stimuli import stimuli
from tests.pid_formula import pid_steps
from tests.quantize.test_lower import leaves_bounds

R = Signal("reference", "rad/s", -100.0, 400.0)
Y = Signal("measurement", "rad/s", -300.0, 350.0)
U = Signal("output", "V", -12.0, 8.0)
MANUAL, SWITCH = Signal("hand", "V", -15.0, 15.0), Signal("engaged", "1", 0.0, 1.0)
ACTUAL = Signal("actual", "V", -20.0, 14.0)
MODES = {
    "plain": ((), {}),
    "manual": ((MANUAL, SWITCH), {"manual": "hand", "automatic": "engaged"}),
    "tracking": ((ACTUAL,), {"tracking": "actual"}),
    "all": ((MANUAL, SWITCH, ACTUAL), {"manual": "hand", "automatic": "engaged", "tracking": "actual"}),
}
H = 0.001


def pid(table: dict[str, object], mode: str = "plain") -> Law:
    wires, keys = MODES[mode]
    return design("pid", "x", {**table, **keys}, H, (R, Y, *wires), (U,), None).law


def inputs(law: Law, steps: int, random: np.random.Generator) -> np.ndarray:
    columns = []
    for wire in law.inputs:
        dwell = np.exp(random.uniform(0, 5, steps)).astype(int) + 1
        levels = np.clip(random.uniform(wire.low - 1, wire.high + 1, steps), wire.low, wire.high)
        ends = np.where(random.random(steps) < 0.5, wire.low, wire.high)
        columns.append(np.repeat(np.where(random.random(steps) < 0.5, levels, ends), dwell)[:steps])
    return np.column_stack(columns)


@settings(max_examples=80, deadline=None, derandomize=True)
@given(
    gains=st.sampled_from(
        [
            {"kp": 0.05, "ki": 3.0, "kd": 1e-3, "tf_s": 0.004, "tt_s": 0.02},
            {"kp": -0.2, "ki": -0.7, "tt_s": 0.001},
            {"kp": 0.02, "ki": 1.0, "kd": 2e-4, "tf_s": 0.002, "b": 0.3, "c": 0.6},
            {"kp": 0.04, "ti_s": 0.05, "td_s": 0.003, "form": "ideal"},
            {"kp": 0.04, "ti_s": 0.05, "td_s": 0.003, "form": "series"},
            {"kp": 0.04, "ki": 2.0, "form": "parallel"},
            {"kp": 0.05, "ki": 3.0, "kd": 1e-3, "tf_s": 0.004, "form": "tustin"},
        ]
    ),
    rate=st.sampled_from([None, 300.0, 1e4]),
    windup=st.sampled_from(["back_calculation", "clamping"]),
    mode=st.sampled_from(sorted(MODES)),
    limits=st.sampled_from([(-12.0, 8.0), (2.0, 7.0)]),
    seed=st.integers(0, 2**32 - 1),
)
def test_the_law_is_the_formula_and_keeps_its_ranges(gains, rate, windup, mode, limits, seed):
    if "actual" in MODES[mode][1].values() and windup == "clamping":
        windup = "back_calculation"
    table = {**gains, "anti_windup": windup, "u_min": limits[0], "u_max": limits[1]}
    table |= {} if rate is None else {"rate_limit_per_s": rate}
    law = pid(table, mode)
    rows = inputs(law, 900, np.random.default_rng(seed))
    x, u, _, _ = law.last.function.mapaccum(len(rows))(np.array(law.start), rows.T)
    x, u = np.array(x), np.array(u).ravel()
    column = {wire.name: rows[:, k].tolist() for k, wire in enumerate(law.inputs)}
    expected = pid_steps(table, H, rows[:, :2], U, column.get("hand"), column.get("engaged"), column.get("actual"))
    np.testing.assert_allclose(u, [wanted for _, wanted in expected], atol=1e-8)
    for k, signal in enumerate(law.state):
        assert signal.low <= x[k].min() and x[k].max() <= signal.high, signal.name


@pytest.mark.parametrize("arithmetic", ARITHMETICS)
@pytest.mark.parametrize("mode", sorted(MODES))
def test_programs_keep_bounds_and_distance(mode: str, arithmetic: str) -> None:
    law = pid({"kp": 0.05, "ki": 3.0, "kd": 1e-3, "tf_s": 0.004, "tt_s": 0.02, "rate_limit_per_s": 900.0}, mode)
    program = lower(law, arithmetic)
    blocks = stimuli(program, [], 6000, 5)
    assert leaves_bounds(program, blocks) == []
    for rounded in measure_rounding(law, program, blocks, run_blocks(program, blocks)):
        assert rounded.worst <= rounded.bound < math.inf


def test_back_to_automatic_is_bumpless() -> None:
    law = pid({"kp": 0.05, "ki": 3.0}, "manual")
    rows = np.array([[50.0, 20.0, 3.25, 0.0]] * 100 + [[50.0, 20.0, 3.25, 1.0]] * 2)
    u = np.array(law.last.function.mapaccum(len(rows))(np.array(law.start), rows.T)[1]).ravel()
    assert u[99] == u[100] == 3.25 and u[101] == pytest.approx(3.25 + 3.0 * H * 30.0)


def test_a_rate_limit_holds_for_every_step() -> None:
    law = pid({"kp": 0.5, "rate_limit_per_s": 200.0})
    rows = inputs(law, 2000, np.random.default_rng(1))
    u = np.array(law.last.function.mapaccum(len(rows))(np.array(law.start), rows.T)[1]).ravel()
    moves = np.abs(np.diff([0.0, *u]))
    assert moves.max() <= 0.2 + 1e-12 and np.mean(moves > 0.19) > 0.1


def test_parallel_is_the_default_to_the_bit() -> None:
    gains = {"kp": 0.05, "ki": 3.0, "kd": 1e-3}
    assert lower(pid(gains), "fixed32").id == lower(pid({**gains, "form": "parallel"}), "fixed32").id


def test_series_is_its_transfer_function() -> None:
    found = design("pid", "x", {"kp": 2.0, "ti_s": 0.5, "td_s": 0.1, "form": "series"}, H, (R, Y), (U,), None).gains
    s = 1j * 3.0
    expected = 2.0 * (1 + 1 / (0.5 * s)) * (1 + 0.1 * s)
    assert found["kp"] + found["ki"] / s + found["kd"] * s == pytest.approx(expected)


def test_margins_are_those_of_automatic_mode() -> None:
    plant = linearize(make_plant("first_order", "drive", ["y"], {"gain": 5.0, "time_constant_s": 0.1, "delay_s": 0.0}))
    gains = {"kp": 0.05, "ki": 0.7}
    assert margins(pid(gains, "manual"), plant) == margins(pid(gains), plant)


@pytest.mark.parametrize(
    ("table", "wires", "words"),
    [
        ({"manual": "hand"}, (MANUAL,), ["manual", "without automatic"]),
        ({"manual": "hand", "automatic": "hand"}, (MANUAL,), ["same signal"]),
        ({"tracking": "nothing"}, (ACTUAL,), ["nothing", "actual"]),
        ({"tracking": "actual", "anti_windup": "clamping"}, (ACTUAL,), ["tracking", "back_calculation"]),
        ({"tracking": "actual", "ki": 0.0}, (ACTUAL,), ["integral", "ki or tt_s"]),
        ({"tracking": "speed"}, (Signal("speed", "rad/s", -1.0, 1.0),), ["'rad/s'", "same unit"]),
        ({"manual": "hand", "automatic": "gate"}, (MANUAL, Signal("gate", "1", 2.0, 3.0)), ["gate", "switch"]),
        ({"rate_limit_per_s": 0.0}, (), ["rate_limit_per_s", "above 0"]),
        ({"form": "ideal"}, (), ["ki", "ti_s and td_s"]),
        ({"ti_s": 1.0}, (), ["ti_s", "ki and kd"]),
    ],
)
def test_what_does_not_go_together_is_told(table, wires, words) -> None:
    with pytest.raises(DesignError) as caught:
        design("pid", "x", {"kp": 0.1, "ki": 1.0, **table}, H, (R, Y, *wires), (U,), None)
    for word in words:
        assert word in str(caught.value)

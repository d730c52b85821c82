"""The kinds that the motor studies compare do what they are for, and say in one sentence what is wrong with a table."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bench.codegen import start_monitor as bench
from bench.codegen import walks
from firmloop.codegen.emit import emit
from firmloop.codegen.target import load_target
from firmloop.design.design import Request
from firmloop.design.kinds import design, kinds
from firmloop.design.kinds.start_monitor import STUDENT
from firmloop.design.law import DesignError, Law
from firmloop.identify.signal import Signal
from firmloop.quantize.lower.lower import lower
from firmloop.verify.run import verify

SPEED = (Signal("reference", "rad/s", -400.0, 400.0), Signal("measurement", "rad/s", -400.0, 400.0))
VOLTS = (Signal("output", "V", -12.0, 12.0),)
NARROW = (
    Signal("natural_frequency", "rad/s", 400.0, 700.0),
    *kinds()["start_monitor"].example.outputs[1:],
)
MINE = ("fuzzy_pid", "self_tuning", "sensorless_speed", "sliding_mode", "start_monitor")


def lagged(law: Law, gain: float, lag: float, reference: np.ndarray, load: float = 0.0, noise: float = 0.0):
    """Close the loop around gain/(lag s + 1) with a load in V and measurement noise: states, measurement."""
    random = np.random.default_rng(5)
    step = law.stages[0].function
    keep = math.exp(-law.period / lag)
    x, y, states, shown = np.array(law.start), 0.0, [], []
    for r in reference:
        x_next, u, _, _ = step(x, [r, y + noise * random.normal()])
        states.append(np.array(x_next).ravel())
        shown.append(y)
        x, y = states[-1], keep * y + (1 - keep) * gain * (float(u) - load)
    return np.array(states), np.array(shown)


def test_the_self_tuner_learns_a_plant_unlike_its_first_guess() -> None:
    table = {"gain": 30.0, "lag_s": 0.1, "time_constant_s": 0.05}
    law = design("self_tuning", "x", table, 0.005, SPEED, VOLTS, None).law
    reference = 150.0 * np.sign(np.sin(np.arange(4000) * 0.005 * 2 * math.pi / 1.5))
    states, shown = lagged(law, 60.0, 0.25, reference, noise=0.5)
    keep = math.exp(-0.005 / 0.25)
    assert states[-1, 0] == pytest.approx(keep, abs=0.01)
    assert states[-1, 1] * 400 / 12 == pytest.approx(60.0 * (1 - keep), rel=0.15)
    settled = slice(3700, 3745)  # of the last half period
    assert np.abs(shown[settled] - reference[settled]).max() < 6.0


def test_the_sliding_mode_holds_against_a_load_and_its_integral_removes_the_rest() -> None:
    reference = np.full(3000, 120.0)
    table = {"gain": 8.0, "layer": 15.0}
    ends = []
    for extra in ({}, {"integral_rad_s": 15.0}):
        law = design("sliding_mode", "x", {**table, **extra}, 0.001, SPEED, VOLTS, None).law
        ends.append(float(lagged(law, 40.0, 0.1, reference, load=2.0)[1][-1]))
    assert ends[0] == pytest.approx(120 - 15 * (120 / 40 + 2) / 8 / (1 + 0), abs=2.0)
    assert ends[1] == pytest.approx(120.0, abs=0.01)


def test_fuzzy_rules_of_one_are_a_pid_and_the_others_change_it() -> None:
    ones = [[1.0] * 3] * 3
    table = {"kp": 0.05, "ki": 0.5, "kd": 0.0, "error_width": 80.0, "change_width": 4.0}
    plain = {**table, "kp_rules": ones, "ki_rules": ones, "kd_rules": ones}
    reference = np.full(1500, 100.0)
    fuzzy = lagged(design("fuzzy_pid", "x", table, 0.001, SPEED, VOLTS, None).law, 40.0, 0.1, reference)[1]
    even = lagged(design("fuzzy_pid", "x", plain, 0.001, SPEED, VOLTS, None).law, 40.0, 0.1, reference)[1]
    gains = {"kp": 0.05, "ki": 0.5, "anti_windup": "none"}
    pid = lagged(design("pid", "x", gains, 0.001, SPEED, VOLTS, None).law, 40.0, 0.1, reference)[1]
    np.testing.assert_allclose(even, pid, atol=1e-9)
    assert np.abs(fuzzy - even).max() > 3.0


def test_the_observer_finds_the_speed_under_a_load_it_does_not_know() -> None:
    request = kinds()["sensorless_speed"].example
    law = design(
        "sensorless_speed", "x", dict(request.table), request.period, request.inputs, request.outputs, None
    ).law
    table = request.table
    r, ke, j, b = (float(table[key]) for key in ("R_ohm", "ke_V_s_rad", "J_kg_m2", "b_N_m_s_rad"))
    x, w, wrong = np.array(law.start), 0.0, []
    for k in range(2000):
        u, load = 8.0, 4e-3 if k > 1000 else 0.0
        i = (u - ke * w) / r  # the winding's 0.1 ms are over within a sample
        x_next, shown, _, _ = law.stages[0].function(x, [u, i])
        wrong.append(float(shown) - w)
        x, w = np.array(x_next).ravel(), w + 1e-3 * (ke * i - b * w - load) / j
    assert np.abs(wrong[990:1000]).max() < 2.0 and np.abs(wrong[-10:]).max() < 2.0
    assert np.abs(wrong[1000:1040]).max() > 4.0, "the load is news to it for a moment"


def test_the_monitor_tells_an_aged_capacitor_from_a_healthy_one() -> None:
    random = np.random.default_rng(3)
    starts = [bench.start(random, share) for share in (1.0, 0.9) for _ in range(5)]
    shown, status = bench.watch("fixed32", starts)
    assert ((status[:, -1] & 2) != 0).tolist() == [False] * 5 + [True] * 5
    for one, word, (n, half, damping) in zip(starts, status, shown[:, -1], strict=True):
        ended = (np.flatnonzero(word & 1)[-1] + 1) * 1e-3
        assert abs(ended - one.ended) < bench.ALLOWED
        assert 1 / (0.010 * n**2) == pytest.approx(one.capacitance, rel=0.03)
        assert 0 < half < 30 and 0.3 < damping < 0.6


def raised(kind: str, **changed: object) -> str:
    request = kinds()[kind].example
    wires = {key: changed.pop(key) for key in ("inputs", "outputs", "period") if key in changed}
    asked: Request = replace(request, **wires, table={**request.table, **changed})  # type: ignore[arg-type]
    with pytest.raises(DesignError) as caught:
        design(kind, "x", dict(asked.table), asked.period, asked.inputs, asked.outputs, None)
    said = str(caught.value)
    assert "\n" not in said and len(said) < 420
    return said


@pytest.mark.parametrize("kind", MINE)
def test_an_unknown_key_is_named(kind: str) -> None:
    assert "gian" in raised(kind, gian=1.0)


@pytest.mark.parametrize(
    ("kind", "changed", "words"),
    [
        ("sliding_mode", {"gain": 0.0}, ["controller.gain = 0", "above 0"]),
        ("sliding_mode", {"layer": -1.0}, ["controller.layer = -1"]),
        ("sliding_mode", {"integral_rad_s": 1000.0}, ["integral_rad_s = 1000", "below 1000"]),
        ("fuzzy_pid", {"kp": 0.0, "ki": 0.0, "kd": 0.0}, ["all 0"]),
        ("fuzzy_pid", {"error_width": 0.0}, ["error_width = 0"]),
        ("fuzzy_pid", {"kp_rules": [[1.0, 1.0], [1.0, 1.0]]}, ["kp_rules", "2 x 2", "3 x 3"]),
        (
            "fuzzy_pid",
            {"ki_rules": [[1.0, 1.0, 1.0], [1.0, -2.0, 1.0], [1.0, 1.0, 1.0]]},
            ["ki_rules", "-2", "negative"],
        ),
        ("self_tuning", {"gain": -3.0}, ["controller.gain = -3"]),
        ("self_tuning", {"lag_s": 1e30}, ["gain = 3", "lag_s = 1e+30", "by 0 of its range"]),
        ("self_tuning", {"forget": 0.5}, ["forget = 0.5", "0.9 to 1"]),
        ("self_tuning", {"u_min": 1.0}, ["u_min = 1", "0 between"]),
        ("sensorless_speed", {"bandwidth_rad_s": 1e5}, ["bandwidth_rad_s = 100000", "at most"]),
        ("sensorless_speed", {"L_H": 0.0}, ["L_H = 0"]),
        ("sensorless_speed", {"outputs": (Signal("speed", "m/s", -1.0, 1.0),)}, ["m/s", "rad/s"]),
        ("start_monitor", {"period": 0.01}, ["period_s = 0.01", "too slow", "60 Hz"]),
        ("start_monitor", {"settle_s": 1e-3}, ["settle_s = 0.001", "five periods"]),
        ("start_monitor", {"capacitance_F": 1e-6}, ["natural_frequency", "rated circuit"]),
        ("start_monitor", {"flag_below": 0.5, "outputs": NARROW}, ["natural_frequency.high = 700", "0.5 of its rated"]),
        ("start_monitor", {"outputs": VOLTS}, ["(V)", "damping ratio"]),
    ],
)
def test_what_is_wrong_is_said_in_one_sentence(kind: str, changed: dict[str, object], words: list[str]) -> None:
    said = raised(kind, **changed)
    assert all(word in said for word in words), said


def test_the_interval_on_line_is_that_of_a_bootstrap_off_line() -> None:
    """A locked rotor in steady state: the mean half width against 400 half samples of all steps at once."""
    table, h, count = kinds()["start_monitor"].example.table, 1e-3, 2000
    w, inductance, r, c = 120 * math.pi, table["inductance_H"], table["resistance_ohm"], table["capacitance_F"]
    k, random = np.arange(count), np.random.default_rng(11)
    phasor = math.sqrt(2) * table["voltage_rms_V"] / (r + 1j * (w * inductance - 1 / (w * c)))
    volts = math.sqrt(2) * table["voltage_rms_V"] * np.cos(w * h * k) + 2.0 * random.normal(size=count)
    current = (phasor * np.exp(1j * w * h * k)).real + 0.3 * random.normal(size=count)
    rows = np.stack([volts, current, np.zeros(count)], axis=1)
    half = bench.watch("fixed32", [bench.Start(rows, c, 0.0)])[0][0, :, 1]

    tau, n0, last = 0.012, 1 / math.sqrt(inductance * c), 0.0
    weights = 2.0 * random.integers(0, 2, size=(count, 400))
    rate = h / (tau * inductance * n0 * abs(phasor) ** 2)
    n, z, drawn = np.full(400, n0), np.full(400, r / 2 * math.sqrt(c / inductance)), []
    for v, i, weight in zip(volts, current, weights, strict=True):
        j = (i * math.cos(w * h) - last) / math.sin(w * h)
        e = v - w * inductance * j + n * (inductance / w * n * j - 2 * inductance * z * i)
        n, z, last = n - weight * rate * w * e * j, z + weight * rate * e * i, i
        drawn.append(n)
    off_line = STUDENT * float(np.mean(np.std(drawn[500:], axis=1)))
    assert float(half[500:].mean()) == pytest.approx(off_line, rel=0.15)


@pytest.mark.qemu
@pytest.mark.parametrize("arithmetic", ["float32", "fixed32", "fixed16"])
def test_the_monitor_keeps_within_its_costs(arithmetic: str) -> None:
    law = kinds()["start_monitor"].design(kinds()["start_monitor"].example).law
    program = lower(law, arithmetic)
    target = load_target("qemu_mps2_an386")
    verdict = verify(law, program, emit(program, "test"), target, (), 2000, 1, None, lambda part, label: None)
    assert verdict.differences == 0
    asked = 0 if arithmetic.startswith("fixed") else 6  # whether an input is no number
    assert verdict.cost.instructions_max is not None and verdict.cost.instructions_max <= 150 + asked
    assert 4 * len(program.state) + 4 * len(program.inputs) + 4 * len(program.outputs) <= 128


@pytest.mark.qemu
def test_a_current_loop_in_doubles_agrees_on_a_core_that_has_no_unit_for_them() -> None:
    """GNU's library rounds 1 - x wrongly there for half of all x about 2^-33, as near the crest of a cosine."""
    law = kinds()["foc"].design(kinds()["foc"].example).law
    program, target = lower(law, "float64"), load_target("qemu_mps2_an386")
    verdict = verify(law, program, emit(program, "test"), target, (), 10_000, 1, None, lambda part, label: None)
    assert verdict.differences == 0


WALKED = (("fuzzy_pid", "fixed16"), ("self_tuning", "fixed32"), ("start_monitor", "fixed16"))


@pytest.mark.parametrize(
    ("kind", "arithmetic"),
    [
        pytest.param(kind, arithmetic, marks=() if (kind, arithmetic) in WALKED else pytest.mark.slow)
        for kind in MINE
        for arithmetic in walks.FORMATS
    ],
)
def test_each_kind_is_generated_and_verified_through_the_command_line(
    kind: str, arithmetic: str, tmp_path: Path
) -> None:
    verdict, said = walks.walk(kind, arithmetic, "host", 200, tmp_path)
    assert verdict, said
    assert verdict["verdict"] == "agrees" and verdict["proven"] == verdict["operations"] > 10
    assert all(one["worst"] <= one["bound"] for one in verdict["rounding"].values())

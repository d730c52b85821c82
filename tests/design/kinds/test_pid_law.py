"""The PID's law computes the contract's formulas: compared with plain Python that knows nothing of CasADi."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from firmloop.design.kinds import design
from firmloop.design.law import Law
from firmloop.identify.signal import Signal

INPUTS = (Signal("reference", "rad/s", -400.0, 300.0), Signal("measurement", "rad/s", -350.0, 400.0))
OUTPUTS = (Signal("output", "V", -12.0, 10.0),)


def pid(table: Mapping[str, object], period: float) -> Law:
    return design("pid", "wheel_speed", table, period, INPUTS, OUTPUTS, None).law


def run(law: Law, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """States before each sample and after the last, outputs, flags; `rows` (n, m)."""
    start = np.array(law.start)
    x, u, flags, _ = law.last.function.mapaccum(len(rows))(start, rows.T)
    return np.hstack([start[:, None], np.array(x)]).T, np.array(u).T, np.array(flags).T


def by_hand(table: dict[str, float], h: float, rows: np.ndarray, mode: str, form: str) -> list[tuple[float, float]]:
    """(v, u) a sample, from contract section 7."""
    kp, ki, kd, tf, b, c, tt = (table[key] for key in ("kp", "ki", "kd", "tf_s", "b", "c", "tt_s"))
    integral = derivative = 0.0
    before = None
    found = []
    for r, y in rows:
        e = r - y
        x = c * r - y
        change = 0.0 if before is None else x - before
        if form == "default":
            derivative = tf / (tf + h) * derivative + kd / (tf + h) * change
            at_once = 0.0
        else:
            derivative = (2 * tf - h) / (2 * tf + h) * derivative + 2 * kd / (2 * tf + h) * change
            at_once = ki * h / 2 * e
        v = kp * (b * r - y) + integral + at_once + derivative
        u = min(max(v, table["u_min"]), table["u_max"])
        if mode == "back_calculation":
            integral = integral + ki * h * e + (h / tt) * (u - v)
        elif mode == "none" or not ((v > table["u_max"] and ki * e > 0) or (v < table["u_min"] and ki * e < 0)):
            integral = integral + ki * h * e
        before = x
        found.append((v, u))
    return found


@settings(max_examples=120, deadline=None, derandomize=True)
@given(
    kp=st.floats(-2, 2),
    ki=st.sampled_from([0.0, 0.3, 5.0, 120.0, -4.0]),
    kd=st.sampled_from([0.0, 1e-3, 0.02, -0.005]),
    tf=st.sampled_from([0.0, 3e-4, 2e-3, 0.1]),
    b=st.sampled_from([0.0, 0.4, 1.0, 1.3]),
    c=st.sampled_from([0.0, 0.5, 1.0]),
    tt=st.sampled_from([1.0, 3.7, 90.0]),
    limits=st.sampled_from([(-12.0, 10.0), (-3.0, 7.5), (0.0, 9.0)]),
    mode=st.sampled_from(["back_calculation", "clamping", "none"]),
    form=st.sampled_from(["default", "tustin"]),
    seed=st.integers(0, 2**32 - 1),
)
def test_the_law_is_the_contract(kp, ki, kd, tf, b, c, tt, limits, mode, form, seed):
    if kp == ki == kd == 0 or (form == "tustin" and tf == 0):
        kp, tf = kp or 0.5, tf or 1e-3
    period = 0.001
    table = {"kp": kp, "ki": ki, "kd": kd, "tf_s": tf, "b": b, "c": c, "tt_s": tt * period}
    table |= {"u_min": limits[0], "u_max": limits[1]}
    law = pid({**table, "anti_windup": mode, "form": form}, period)
    random = np.random.default_rng(seed)
    rows = np.column_stack([random.uniform(signal.low, signal.high, 300) for signal in INPUTS])
    rows *= 10.0 ** random.uniform(-3, 0, (300, 1))  # so that the output is not always at a limit
    _, u, flags = run(law, rows)
    expected = by_hand(table, period, rows, mode, form)
    scale = 1e-9 * max(1.0, *(abs(v) for v, _ in expected))
    for k, (v, wanted) in enumerate(expected):
        assert math.isclose(u[k, 0], wanted, rel_tol=0, abs_tol=scale), (k, v)
        if abs(v - limits[0]) > scale and abs(v - limits[1]) > scale:
            assert bool(flags[k, 0]) == (v != wanted), (k, v)


def test_first_sample_has_no_derivative():
    law = pid({"kp": 0.0, "kd": 0.01, "tf_s": 0.0, "c": 1.0}, 0.001)
    _, u, _ = run(law, np.array([[300.0, -300.0], [300.0, -299.5], [300.0, -299.5]]))
    assert u.ravel().tolist() == pytest.approx([0.0, -5.0, 0.0])


def test_two_inputs_in_file_order_are_reference_and_measurement():
    inputs = (Signal("wanted", "1", -1.0, 1.0), Signal("seen", "1", -1.0, 1.0))
    law = design("pid", "x", {"kp": 2.0}, 0.1, inputs, (Signal("drive", "1", -5.0, 5.0),), None).law
    assert run(law, np.array([[1.0, 0.25]]))[1][0, 0] == pytest.approx(1.5)
    swapped = (Signal("measurement", "1", -1.0, 1.0), Signal("reference", "1", -1.0, 1.0))
    law = design("pid", "x", {"kp": 2.0}, 0.1, swapped, (Signal("drive", "1", -5.0, 5.0),), None).law
    assert run(law, np.array([[0.25, 1.0]]))[1][0, 0] == pytest.approx(1.5)


@pytest.mark.parametrize(
    ("table", "state"),
    [
        ({"kp": 1.0}, []),
        ({"kp": 1.0, "ki": 2.0}, ["integral"]),
        ({"kp": 1.0, "tt_s": 0.1}, ["integral"]),
        ({"kp": 1.0, "kd": 0.1, "tf_s": 0.0}, ["filtered", "started"]),
        ({"kp": 1.0, "ki": 2.0, "kd": 0.1}, ["integral", "filtered", "started"]),
    ],
)
def test_state_only_where_it_is_needed(table, state):
    law = pid(table, 0.01)
    assert [signal.name for signal in law.state] == state
    assert len(law.why) == len(law.start) == len(state)


def test_defaults():
    found = design("pid", "x", {"kp": 2, "ki": 4, "kd": 0.5}, 0.001, INPUTS, OUTPUTS, None).gains
    expected = {"kp": 2, "ki": 4, "kd": 0.5, "tf_s": 0.025, "b": 1, "c": 0, "u_min": -12, "u_max": 10}
    assert found == pytest.approx({**expected, "tt_s": math.sqrt(0.5 * 0.25)})
    assert design("pid", "x", {"kp": 2, "ki": 4}, 0.001, INPUTS, OUTPUTS, None).gains["tt_s"] == pytest.approx(0.5)
    assert design("pid", "x", {"kp": 2, "ki": 4000}, 0.001, INPUTS, OUTPUTS, None).gains["tt_s"] == 0.001

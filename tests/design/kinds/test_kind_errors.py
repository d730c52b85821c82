"""What a user can get wrong in each kind's table is told in one sentence with key, value, rule and way out."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from firmloop.design.kinds import design, kinds
from firmloop.design.law import DesignError
from firmloop.identify.signal import Signal
from firmloop.quantize.lower.lower import lower
from firmloop.quantize.program import QuantizeError

R, Y = Signal("reference", "m", -1.0, 1.0), Signal("measurement", "m", -1.0, 1.0)
S = Signal("level", "1", 0.0, 10.0)
U, V = Signal("output", "V", -12.0, 12.0), Signal("other", "V", -1.0, 1.0)
H = 0.01
SPACE = {"A": [[0.5]], "B": [[1.0, -1.0]], "C": [[1.0]]}
LQR = {"A": [[1.0, 0.01], [0.0, 0.9]], "B": [[0.0], [0.1]], "C": [[1.0, 0.0]], "Q": 1.0, "R": 1.0}
SEEN = {**LQR, "observer": "kalman", "process_noise": 0.1, "measurement_noise": 0.1}
TWO = [{"kp": 1.0, "ki": 1.0}, {"kp": 2.0, "ki": 1.0}]
LEAD = {"kind": "lead_lag", "zero_rad_s": 10.0, "pole_rad_s": 60.0}
PLAN = {"schedule_on": "level", "points": [0.0, 10.0], "controllers": TWO}


def raised(kind: str, table: dict[str, object], inputs=(R, Y), outputs=(U,)) -> str:
    with pytest.raises(DesignError) as caught:
        design(kind, "x", table, H, inputs, outputs, None)
    said = str(caught.value)
    assert "\n" not in said and len(said) < 400
    return said


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ({}, ["numerator", "missing", "list"]),
        ({"numerator": [], "denominator": [1.0]}, ["numerator", "empty list of numbers"]),
        ({"numerator": 3.0, "denominator": [1.0]}, ["numerator", "list of numbers"]),
        ({"numerator": [0.0], "denominator": [1.0]}, ["numerator", "zero"]),
        ({"numerator": [1.0], "denominator": [0, 0.0]}, ["denominator", "zero"]),
        ({"numerator": [math.nan], "denominator": [1.0]}, ["numerator", "nan", "finite"]),
        ({"numerator": [1.0, 0.0], "denominator": [1.0]}, ["numerator", "samples to come"]),
        ({"numerator": [1.0, 0.0], "denominator": [1.0], "domain": "s"}, ["numerator", "pole"]),
        ({"numerator": [1.0], "denominator": [1.0, -1.5]}, ["unstable", "z = 1.5"]),
        ({"numerator": [1.0], "denominator": [1.0, -2.0, 1.7]}, ["unstable", "1+0.83666j"]),
        ({"numerator": [1.0], "denominator": [1.0, -5.0], "domain": "s"}, ["unstable"]),
        ({"numerator": [1.0], "denominator": [1.0, *[0.0] * 99, -0.5]}, ["100 states", "at most 64", "split"]),
        ({"numerator": [1.0], "denominator": [1.0, -0.5], "discretize": "zoh"}, ["discretize", "domain"]),
        ({"numerator": [1.0], "denominator": [1.0, 5.0], "domain": "s", "discretize": "euler"}, ["euler", "zoh"]),
        ({"numerator": [1.0], "denominator": [1.0, 5.0], "domain": "s", "discretize": "prewarp"}, ["prewarp_rad_s"]),
        ({"numerator": [1.0], "denominator": [1, 5], "domain": "s", "prewarp_rad_s": 1.0}, ["prewarp_rad_s", "tustin"]),
        (
            {"numerator": [1], "denominator": [1, 5], "domain": "s", "discretize": "prewarp", "prewarp_rad_s": 400.0},
            ["prewarp_rad_s", "400", "Nyquist"],
        ),
        ({"numerator": [1e300], "denominator": [1e-300]}, ["infinite"]),
        ({"numerator": [1.0], "denominator": [1e-200, 1e200]}, ["far apart"]),
        ({"numerator": [1.0], "denominator": [1.0, -0.5], "u_max": 13.0}, ["u_max", "13", "-12 to 12"]),
        ({"numerator": [1.0], "denominator": [1.0, -0.5], "u_min": [1.0, 2.0]}, ["u_min", "2 numbers for 1"]),
        ({"numerator": [1.0], "denominator": [1.0, -0.5], "form": "direct"}, ["direct", "delta"]),
    ],
)  # fmt: skip
def test_transfer_function(table, words):
    said = raised("transfer_function", table)
    assert all(word in said for word in words), said


@pytest.mark.parametrize(
    ("kind", "table", "words"),
    [
        ("notch", {"frequency_hz": 50.0}, ["frequency_hz = 50 Hz", "Nyquist", "= 50 Hz", "period_s below"]),
        ("notch", {"frequency_rad_s": 400.0}, ["frequency_rad_s = 400 rad/s", "Nyquist", "= 314.159 rad/s"]),
        ("state_space", {"A": [], "B": [], "C": []}, ["controller.A has no rows"]),
        ("pid", {"kp": 1.0, "u_max": 24.0}, ["u_max = 24", "signals.output", "from -12 to 12"]),
        ("pid", {"kp": 1.0, "u_min": 5.0, "u_max": -5.0}, ["u_min = 5", "u_max = -5", "u_min below u_max"]),
        ("notch", {"frequency_hz": 90.0}, ["Nyquist"]),
        ("notch", {"frequency_hz": 1.0, "frequency_rad_s": 6.0}, ["both"]),
        ("notch", {"frequency_rad_s": 20.0, "depth": 1.5}, ["depth", "0 to 1"]),
        ("notch", {}, ["frequency_rad_s", "missing"]),
        ("lead_lag", {"zero_rad_s": 1.0}, ["pole_rad_s", "missing"]),
        ("lead_lag", {"zero_rad_s": 1.0, "phase_deg": 30.0, "frequency_rad_s": 10.0}, ["zero_rad_s", "beside"]),
        ("lead_lag", {"phase_deg": 90.0, "frequency_rad_s": 10.0}, ["phase_deg", "-89 to 89"]),
        ("lead_lag", {"zero_rad_s": 1.0, "pole_rad_s": 2.0, "gain": 0.0}, ["gain", "0"]),
    ],
)
def test_filters(kind, table, words):
    said = raised(kind, table)
    assert all(word in said for word in words), said


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ({}, ["A", "missing"]),
        ({**SPACE, "A": [0.5]}, ["A", "list of rows"]),
        ({**SPACE, "A": [[0.5, 0.0]]}, ["A is 1 x 2", "1 x 1"]),
        ({**SPACE, "A": [[0.5, 0.0], [0.1]]}, ["A", "same length"]),
        ({**SPACE, "B": [[1.0]]}, ["B is 1 x 1", "1 x 2", "2 inputs"]),
        ({**SPACE, "C": [[1.0], [2.0]]}, ["C is 2 x 1", "1 outputs"]),
        ({**SPACE, "D": [[1.0]]}, ["D is 1 x 1", "1 x 2"]),
        ({**SPACE, "A": [[1.2]]}, ["unstable", "1.2"]),
        ({**SPACE, "A": [["x"]]}, ["A", "not a number"]),
        ({**SPACE, "A": [[math.inf]]}, ["A", "finite"]),
        ({**SPACE, "x_min": 0.5, "x_max": 1.0}, ["x_min", "starts at 0"]),
        ({**SPACE, "x_min": -1.0}, ["x_min", "both or neither"]),
        ({**SPACE, "E": 1.0}, ["E", "no such key"]),
    ],
)
def test_state_space(table, words):
    said = raised("state_space", table)
    assert all(word in said for word in words), said


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ({"Q": 1.0, "R": 1.0}, ["model", "[plant]"]),
        ({"K": [[1.0, 2.0]]}, ["reference_gain", "missing"]),
        ({**SEEN, "R": 0.0}, ["R", "positive definite"]),
        ({**SEEN, "Q": [1.0]}, ["Q", "1 numbers", "2"]),
        ({**SEEN, "Q": -1.0}, ["Q", "not negative"]),
        ({**SEEN, "Q": 0.0}, ["Q and R", "unstable", "z = 1 "]),
        ({**SEEN, "K": [[1.0, 1.0]]}, ["K", "beside Q"]),
        ({**LQR, "observer": "luenberger", "observer_poles": [0.5]}, ["observer_poles", "1 poles for 2"]),
        ({**LQR, "observer": "luenberger", "observer_poles": [0.5, 1.0]}, ["observer_poles", "outside"]),
        (
            {**LQR, "observer": "luenberger", "observer_poles": [0.5, 0.5], "C": [[0, 1]], "reference_gain": 1.0},
            ["every state"],
        ),
        ({**SEEN, "observer": "luenburger"}, ["luenburger", "did you mean 'luenberger'"]),
        ({**SEEN, "observer_poles": [0.1, 0.2]}, ["observer_poles", "kalman"]),
        (LQR, ["one input a state", "observer"]),
        ({**SEEN, "B": [[0.0]]}, ["B is 1 x 1"]),
        ({**{key: SEEN[key] for key in SEEN if key not in "QR"}, "K": [[-9.0, 0.0]]}, ["unstable", "loop"]),
    ],
)
def test_state_feedback(table, words):
    said = raised("state_feedback", table)
    assert all(word in said for word in words), said


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ({**PLAN, "points": []}, ["points", "list of numbers"]),
        ({**PLAN, "controllers": []}, ["controllers", "list of tables"]),
        ({**PLAN, "points": [0.0, 0.0]}, ["points", "rise"]),
        ({**PLAN, "points": [5.0, 1.0]}, ["points", "rise", "1 follows 5"]),
        ({**PLAN, "points": [1.0, 2.0, 3.0]}, ["3 values", "2 controllers"]),
        ({**PLAN, "points": [1.0], "controllers": TWO[:1]}, ["at least two"]),
        ({**PLAN, "points": [0.0, 1e-320]}, ["0 and 9.99989e-321", "near"]),
        ({**PLAN, "schedule_on": "lever"}, ["lever", "did you mean 'level'"]),
        ({**PLAN, "controllers": [{"kp": 1.0}, {"kq": 1.0}]}, ["point 2", "kq"]),
        ({**PLAN, "controllers": [{"kp": 1.0}, {"kind": "notch"}]}, ["point 1", "pid", "point 2", "notch"]),
        ({**PLAN, "controllers": [{"kp": 1.0}, {"kind": "mpc"}]}, ["point 2", "mpc", "known: pid, lead_lag, notch"]),
        ({**PLAN, "controllers": [LEAD, {"kind": "notch"}]}, ["point 2", "frequency_rad_s", "missing"]),
        ({**PLAN, "controllers": [LEAD, {**LEAD, "frequency_rad_s": 400.0}]}, ["point 2", "zero_rad_s"]),
        ({**PLAN, "controllers": [LEAD, {**LEAD, "u_max": 2.0}]}, ["1 and 2", "u_max = 12 and 2", "same"]),
        ({**PLAN, "controllers": [LEAD, {**LEAD, "u_max": -20.0}]}, ["point 2", "u_max", "out of order or range"]),
        ({**PLAN, "controllers": [LEAD, {"kind": "state_space"}]}, ["point 2", "controller.A", "missing"]),
        ({**PLAN, "controllers": [LEAD, {"kind": "state_space", **SPACE, "A": [[1.5]]}]}, ["point 2", "unstable"]),
        ({**PLAN, "controllers": [LEAD, LEAD], "feedforward": {"from": "effects"}}, ["feedforward", "pids"]),
        ({**PLAN, "controllers": [LEAD, {**LEAD, "plant": {"gain": 2.0}}]}, ["point 2", "plant", "[plant]"]),
        ({**PLAN, "controllers": [{"kind": "lead_lag"}, LEAD]}, ["point 1", "zero_rad_s"]),
        ({**PLAN, "controllers": [TWO[0], {"kp": 1.0, "u_max": 3.0}]}, ["1 and 2", "u_max", "same"]),
        ({**PLAN, "points": [{"at": 0.0, "kp": 1.0}, {"kp": 1.0}]}, ["controllers", "beside"]),
    ],
)
def test_gain_schedule(table, words):
    said = raised("gain_schedule", table, inputs=(R, Y, S))
    assert all(word in said for word in words), said


def test_points_may_be_the_tables() -> None:
    one = design("gain_schedule", "x", PLAN, H, (R, Y, S), (U,), None).law
    points = [{"at": at, **gains} for at, gains in zip(PLAN["points"], TWO, strict=True)]
    other = design("gain_schedule", "x", {"schedule_on": "level", "points": points}, H, (R, Y, S), (U,), None).law
    assert lower(one, "fixed32").id == lower(other, "fixed32").id


@pytest.mark.parametrize("kind", ["transfer_function", "notch", "lead_lag"])
def test_wires(kind):
    table = {**kinds()[kind].example.table, **({"frequency_hz": 20.0} if kind == "notch" else {})}
    assert "same unit" in raised(kind, table, inputs=(R, S))
    assert "one output" in raised(kind, table, outputs=(U, V))
    assert "one output" in raised(kind, table, inputs=(R, Y, S))


def test_an_integrator_is_for_floats_unless_it_is_limited() -> None:
    integrator = {"A": [[1.0]], "B": [[0.1, -0.1]], "C": [[1.0]]}
    law = design("state_space", "x", integrator, H, (R, Y), (U,), None).law
    assert law.state[0].high == math.inf and "unit circle" in law.why[0]
    lower(law, "float32")
    with pytest.raises(QuantizeError, match="no finite proven range"):
        lower(law, "fixed32")
    for a in (1.0, 1.3):  # with limits even an unstable one has a range
        limited = {**integrator, "A": [[a]], "x_min": -5.0, "x_max": 8.0}
        lower(design("state_space", "x", limited, H, (R, Y), (U,), None).law, "fixed16")


@pytest.mark.parametrize("span", [1e-300, 1e300])
def test_ranges_beyond_all_formats_are_told(span: float) -> None:
    wires = (Signal("reference", "m", -span, span), Signal("measurement", "m", -span, span))
    with pytest.raises((QuantizeError, DesignError), match=r"smaller unit|leave all numbers|rescale"):
        lower(design("lead_lag", "x", {"zero_rad_s": 10.0, "pole_rad_s": 60.0}, H, wires, (U,), None).law, "fixed32")
    with pytest.raises(QuantizeError, match="leave all numbers"):
        lower(design("pid", "x", {"kp": 1e308}, H, (R, replace(Y, high=9.0)), (U,), None).law, "fixed32")


def test_what_has_no_range_says_why() -> None:
    law = design("transfer_function", "x", {"numerator": [0.1], "denominator": [1.0, -1.0]}, H, (R, Y), (U,), None).law
    with pytest.raises(QuantizeError, match=r"w1_1 has no finite proven range \(no bound: a pole on the unit circle"):
        lower(law, "fixed32")


def test_coefficients_beyond_fixed_point_are_told() -> None:
    for size in (1e-30, 1e30):
        law = design("state_space", "x", {**SPACE, "B": [[size, 1.0]]}, H, (R, Y), (U,), None).law
        with pytest.raises(QuantizeError, match=r"cannot be held|too large|no fixed-point format"):
            lower(law, "fixed32")


ODD = st.sampled_from([0.0, 1.0, -1.0, 0.5, 0.99, 1e-30, 1e30, -1e300, math.nan, math.inf, "x", None, [], True, [1.0]])


@settings(max_examples=150, deadline=None, derandomize=True)
@given(data=st.data(), kind=st.sampled_from(sorted(kinds())))
def test_no_table_ends_in_anything_but_a_law_or_a_sentence(data, kind):
    example = kinds()[kind].example
    key = data.draw(st.sampled_from(sorted(example.table)))
    value = example.table[key]
    odd = data.draw(ODD)
    if isinstance(value, list) and data.draw(st.booleans()):
        place = data.draw(st.integers(0, len(value) - 1))
        inner = value[place]
        odd = [odd if k == 0 else x for k, x in enumerate(inner)] if isinstance(inner, list) else odd
        odd = [odd if k == place else x for k, x in enumerate(value)]
    table = {**example.table, key: odd}
    try:
        found = design(kind, "x", table, example.period, example.inputs, example.outputs, None)
    except DesignError as error:
        assert re.search(r"[.;:,]", str(error)) and "\n" not in str(error)
        return
    assert all(state.low <= start <= state.high for state, start in zip(found.law.state, found.law.start, strict=True))


@pytest.mark.parametrize("kind", ["pid", "transfer_function"])
def test_a_reference_that_no_measurement_reaches(kind: str) -> None:
    table = {"kp": 1.0} if kind == "pid" else {"numerator": [1.0], "denominator": [1.0, -0.5]}
    said = raised(kind, table, inputs=(R, Signal("measurement", "m", 10.0, 20.0)))
    assert "from -1 to 1" in said and "from 10 to 20" in said and "never meet" in said


def test_a_rate_that_moves_nothing_in_fixed_point_is_told() -> None:
    law = design("pid", "x", {"kp": 1.0, "rate_limit_per_s": 1e-9}, H, (R, Y), (U,), None).law
    with pytest.raises(QuantizeError, match="moved by -1e-11, which is nothing there"):
        lower(law, "fixed32")
    lower(law, "float64")


def test_numbers_beyond_all_numbers_are_told() -> None:
    table = {"kp": 1.0, "ki": 1.0, "kd": 0.0, "error_width": 1e-320, "change_width": 1.0}
    with pytest.raises(QuantizeError, match="beyond all numbers"):
        lower(design("fuzzy_pid", "x", table, H, (R, Y), (U,), None).law, "fixed32")
    fast = {"numerator": [1.0], "denominator": [1.0, 1e9, 1e30], "domain": "s", "discretize": "zoh"}
    assert "nothing but rounding" in raised("transfer_function", fast)

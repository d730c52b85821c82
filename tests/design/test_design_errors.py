"""What a user can get wrong in [controller] and [signals] is told with key, value, rule and way out."""

from __future__ import annotations

import pytest

from firmloop.design.kinds import design, kinds
from firmloop.design.law import DesignError
from firmloop.design.tuning import rules
from firmloop.identify.signal import Signal

R = Signal("reference", "rad/s", -400.0, 400.0)
Y = Signal("measurement", "rad/s", -400.0, 400.0)
U = Signal("output", "V", -12.0, 12.0)
GOOD = {"kp": 0.1, "ki": 1.0}


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ({"kq": 1.0, **GOOD}, ["kq", "did you mean 'k"]),
        ({"zzzzzz": 1.0, **GOOD}, ["zzzzzz", "known keys", "anti_windup"]),
        ({"tau_c_s": 1.0, **GOOD}, ["tau_c_s", "no such key"]),
        ({"ki": 1.0}, ["kp", "missing"]),
        ({"kp": "0.1"}, ["kp", "'0.1'", "not a number"]),
        ({"kp": True}, ["kp", "True", "not a number"]),
        ({"kp": [0.1]}, ["kp", "[0.1]", "not a number"]),
        ({"kp": float("nan")}, ["kp", "nan", "not finite"]),
        ({"kp": 10**400}, ["kp", "not finite"]),
        ({**GOOD, "ki": float("inf")}, ["ki", "inf", "not finite"]),
        ({"kp": 0.0, "ki": 0, "kd": 0}, ["all 0", "tune"]),
        ({**GOOD, "tf_s": -0.1}, ["tf_s", "-0.1", "at least 0"]),
        ({"kp": 0.0, "kd": 0.1}, ["tf_s", "missing"]),
        ({**GOOD, "tf_s": 1e30}, ["tf_s = 1e+30", "no filter", "shorter"]),
        ({**GOOD, "kd": 0.1, "tf_s": 1e-30, "form": "tustin"}, ["tf_s = 1e-30", "no filter", "longer"]),
        ({**GOOD, "kd": 0.1, "tf_s": 0.0, "form": "tustin"}, ["tf_s", "tustin", "above 0"]),
        ({**GOOD, "tt_s": 0.0}, ["tt_s", "above 0"]),
        ({**GOOD, "tt_s": 0.0005}, ["tt_s", "0.0005", "period_s"]),
        ({**GOOD, "u_max": 13.0}, ["u_max", "13", "from -12 to 12"]),
        ({**GOOD, "u_min": 5.0, "u_max": 5.0}, ["u_min = 5 and u_max = 5", "u_min below u_max"]),
        ({**GOOD, "anti_windup": "back_calculaton"}, ["back_calculaton", "did you mean 'back_calculation'"]),
        ({**GOOD, "anti_windup": 3}, ["anti_windup", "3", "not a text"]),
        ({**GOOD, "form": "ideal"}, ["ki", "ideal", "ti_s and td_s"]),
        ({"tune": "sinc"}, ["sinc", "did you mean 'simc'"]),
        ({"tune": "simc"}, ["simc", "needs a plant"]),
        ({"tune": "simc", "kp": 0.1}, ["kp", "beside", "remove one"]),
        ({"kp": 1e308, "ki": 1.0, "b": 10.0}, ["too large"]),
        ({"kp": 1e308}, None),
        ({"kp": 1e308, "ki": 1e300}, ["integral", "smaller"]),
    ],
)
def test_controller_table(table, words):
    if words is None:
        assert not design("pid", "x", table, 0.001, (R, Y), (U,), None).law.state
        return
    with pytest.raises(DesignError) as caught:
        design("pid", "x", table, 0.001, (R, Y), (U,), None)
    for word in words:
        assert word in str(caught.value)


@pytest.mark.parametrize(
    ("inputs", "outputs", "words"),
    [
        ((R,), (U,), ["exactly", "reference"]),
        ((R, Y, Signal("load", "A", 0.0, 1.0)), (U,), ["exactly", "load"]),
        ((R, Y), (), ["exactly"]),
        ((R, Signal("measurement", "rad", -1.0, 1.0)), (U,), ["'rad/s'", "'rad'", "same unit"]),
        ((R, Signal("measurement", "rad/s", 4.0, -4.0)), (U,), ["measurement", "low below high"]),
        ((R, Signal("measurement", "rad/s", 0.0, float("inf"))), (U,), ["measurement", "finite"]),
        ((R, R), (U,), ["twice", "rename"]),
        ((R, Signal("integral", "rad/s", -1.0, 1.0)), (U,), ["integral", "rename"]),
    ],
)
def test_signals(inputs, outputs, words):
    with pytest.raises(DesignError) as caught:
        design("pid", "x", GOOD, 0.001, inputs, outputs, None)
    for word in words:
        assert word in str(caught.value)


@pytest.mark.parametrize("period", [0.0, -1.0, float("nan"), float("inf")])
def test_period(period):
    with pytest.raises(DesignError, match="period_s"):
        design("pid", "x", GOOD, period, (R, Y), (U,), None)


def test_unknown_kind():
    with pytest.raises(DesignError, match="did you mean 'pid'"):
        design("pidd", "x", GOOD, 0.001, (R, Y), (U,), None)


def test_shared_keys_are_not_the_kinds_business():
    table = {**GOOD, "kind": "pid", "period_s": 0.001, "outputs": ["output"]}
    assert design("pid", "x", table, 0.001, (R, Y), (U,), None).tuned_by is None


@pytest.mark.parametrize("kind", kinds().values(), ids=kinds().keys())
def test_the_example_of_every_kind_designs(kind):
    law = kind.design(kind.example).law
    assert len(law.state) == len(law.start) == len(law.why)
    assert all(low.low <= start <= low.high for low, start in zip(law.state, law.start, strict=True))


def test_rules_are_found():
    assert "simc" in rules() and all(rule.keys for rule in rules().values())


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ([3.0, 0.5], "write K = [[3.0, 0.5]] for one row, K = [[3.0], [0.5]] for one column"),
        ([3.0], "write K = [[3.0]]"),
        (3.0, "write K = [[3.0]]"),
        ([3.0, "a"], "write it like K = [[1.0, 0.0], [0.0, 1.0]]"),
    ],
)
def test_numbers_that_stand_alone_are_shown_as_rows(given, words):
    table = {"A": [[1.0, 0.1], [0.0, 0.9]], "B": [[0.0], [0.1]], "K": given, "states": ["reference", "measurement"]}
    with pytest.raises(DesignError) as caught:
        design("state_feedback", "x", table, 0.001, (R, Y), (U,), None)
    assert str(caught.value) == f"controller.K is not a list of rows; {words}"

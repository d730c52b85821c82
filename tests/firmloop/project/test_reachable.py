"""`design` and `tune` say which references the actuator cannot hold, and are silent where it can."""

from __future__ import annotations

import json

import pytest

from firmloop.cli import main

HEATER = """\
schema = 1
name = "tank"
[plant]
kind = "first_order"
input = "heater_percent"
outputs = ["temperature_C"]
[plant.parameters]
gain = GAIN
time_constant_s = 100.0
delay_s = 5.0
[controller]
kind = "pid"
period_s = 1.0
kp = KP
ki = 0.0
[signals]
reference = { unit = "degC", low = LOW, high = HIGH }
measurement = { unit = "degC", low = -50, high = 250 }
output = { unit = "%", low = 0, high = 100 }
[arithmetic]
number = "float64"
"""


@pytest.mark.parametrize(
    ("gain", "low", "high", "held"),
    [
        ("0.6", 0, 200, "at 0 to 60 degC"),
        ("0.6\noutput_at_rest = 20.0", 20, 200, "at 20 to 80 degC"),
        ("-0.4\noutput_at_rest = 60.0", 0, 60, "at 20 to 60 degC"),
        ("0.6", 0, 62, ""),
        ("0.6\noutput_at_rest = 20.0", 20, 80, ""),
    ],
)
def test_a_reference_beyond_what_the_heater_holds_is_told(gain, low, high, held, tmp_path, capsys):
    values = {"GAIN": gain, "KP": "-1.0" if gain.startswith("-") else "1.0", "LOW": str(low), "HIGH": str(high)}
    text = HEATER
    for name, value in values.items():
        text = text.replace(name, value)
    (tmp_path / "tank.toml").write_text(text)
    assert main(["design", str(tmp_path / "tank.toml"), "--out", str(tmp_path / "out")]) == 0
    said = capsys.readouterr().out
    assert (f"{held} at rest: what is asked beyond that is never reached" in said) if held else "never" not in said


def tuned(tmp_path, capsys, signal, rest):
    """Return what `tune` prints and leaves of a heater of 0.5 degC a percent, 50 degC from end to end."""
    text = HEATER.replace("gain = GAIN", f"gain = 0.5\noutput_at_rest = {rest}").replace("kp = KP\nki = 0.0\n", "")
    text = text.replace("low = LOW, high = HIGH", signal).replace("low = -50, high = 250", "low = -50, high = 400")
    (tmp_path / "tank.toml").write_text(text + '[tuning]\nrules = ["simc", "amigo"]\n')
    assert main(["tune", str(tmp_path / "tank.toml"), "--out", str(tmp_path / "out")]) == 0
    return capsys.readouterr().out, json.loads((tmp_path / "out" / "tuning.json").read_text())


def test_tune_says_that_its_step_is_not_reached(tmp_path, capsys):
    """A quarter of 120 degC from the middle of the output, which goes 25 degC either way."""
    said, document = tuned(tmp_path, capsys, "low = 80, high = 120", 20.0)
    (ends,) = {entry["unreached"]["end"] for entry in document["rules"]}
    assert ends == pytest.approx(24.5, abs=0.5)
    assert all(
        (entry["unreached"]["size"], entry["unreached"]["unit"]) == (30.0, "degC") for entry in document["rules"]
    )
    words = f"reference not reached: {ends:.3g} of 30 degC, the output at its limit; rise, settling, overshoot"
    wide = "at 20 to 70 degC at rest: what is asked beyond that is never reached"
    assert said.count(words) == said.count(wide) == 1
    assert sum(words in note or wide in note for note in document["notes"]) == 2


def test_a_step_of_a_range_far_from_zero_is_not_reached_though_the_range_is(tmp_path, capsys):
    """In kelvin a quarter of 323 is more than the plant can move; every reference can be held."""
    said, document = tuned(tmp_path, capsys, "low = 273, high = 323", 273.0)
    assert "of 80.8 degC, the output at its limit" in said and "asked beyond" not in said
    assert document["rules"][0]["unreached"]["size"] == 80.75


def test_tune_is_silent_where_its_step_is_reached(tmp_path, capsys):
    said, document = tuned(tmp_path, capsys, "low = 20, high = 70", 20.0)
    assert "reached" not in said and not any("reached" in note for note in document["notes"])
    assert [entry["unreached"] for entry in document["rules"]] == [None, None]


@pytest.mark.parametrize("verb", ["design", "tune"])
@pytest.mark.parametrize(
    ("gain", "says"),
    [
        ("1e-25", "lower its gains"),
        ("1e-5", "lower its gains"),
        ("1e8", "moves its output by less than a millionth of its range; raise its gains"),
    ],
)
def test_gains_that_were_tuned_to_a_gain_beyond_all_measure_blame_the_plant(gain, says, verb, tmp_path, capsys):
    """Where a rule that only reads the model gives gains that the output's limits never let act."""
    values = {"GAIN": gain, "kp = KP\nki = 0.0": 'tune = "simc"', "LOW": "20", "HIGH": "90"}
    text = HEATER
    for name, value in values.items():
        text = text.replace(name, value)
    (tmp_path / "tank.toml").write_text(text)
    status = main([verb, str(tmp_path / "tank.toml"), "--out", str(tmp_path / "out")])
    shown = capsys.readouterr()
    if verb == "tune" and gain == "1e8":  # which measures about the middle of the output, where none of its ends is
        assert status == 0
        return
    assert status == 2, shown
    assert "stands at a limit at every point tried" in shown.err and says in shown.err
    held = f"output from 0 to 100 % holds it at 0 to {100 * float(gain):.4g} degC at rest"
    assert f"{held}, and reference may be 20 to 90 degC: check its gain" in shown.err
    assert not (tmp_path / "out").exists() or not [*(tmp_path / "out").iterdir()]


def test_a_rule_that_gives_no_gain_but_0_is_one_not_for_this_plant(tmp_path, capsys):
    text = HEATER.replace("GAIN", "1e-25").replace("kp = KP\nki = 0.0", 'tune = "lqr"')
    (tmp_path / "tank.toml").write_text(text.replace("LOW", "20").replace("HIGH", "90"))
    assert main(["generate", str(tmp_path / "tank.toml"), "--out", str(tmp_path / "out")]) == 2
    assert "lqr gives no gain but 0 for this plant; check the plant's parameters" in capsys.readouterr().err

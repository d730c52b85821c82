"""`design` says which references the actuator cannot hold, and is silent where it can."""

from __future__ import annotations

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

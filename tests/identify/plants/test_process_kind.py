"""The process kind is the transfer function it says, of two lags or one, and is found again with zero and delay."""

from __future__ import annotations

import control
import numpy as np
import pytest

from firmloop.identify.error import IdentifyError
from firmloop.identify.fitting.fit import fit
from firmloop.identify.plants.kinds import make_plant
from firmloop.identify.recordings.conditioning import NONE
from firmloop.identify.recordings.recording import make_recording
from firmloop.identify.simulation.linearize import linearize
from firmloop.identify.simulation.simulate import simulate

NAMES = ("gain", "time_constant_s", "second_time_constant_s", "zero_time_constant_s", "delay_s")
S = control.tf([1, 0], [1])


def process(*values: float, free: bool = True):
    table = {name: {"value": value, "free": free and value != 0.0} for name, value in zip(NAMES, values, strict=True)}
    return make_plant("process", "valve_V", ["level"], table)


@pytest.mark.parametrize(
    "values", [(2.0, 0.5, 0.1, 0.25, 0.06), (-1.0, 0.3, 0.2, -0.4, 0.0), (3.0, 0.4, 0.0, 0.1, 0.02)]
)
def test_it_is_its_transfer_function(values):
    gain, lag, lag2, lead, delay = values
    linear = linearize(process(*values))
    assert linear.delay == delay
    made = control.ss(linear.a, linear.b, linear.c, linear.d)
    expected = gain * (lead * S + 1) / ((lag * S + 1) * (lag2 * S + 1))
    frequency = np.geomspace(0.1, 100, 20)
    assert made(1j * frequency) == pytest.approx(expected(1j * frequency), rel=1e-9)


@pytest.mark.parametrize("lead", [0.25, -0.15])
def test_it_is_found_again(lead):
    """Without starting values, from a binary signal: every parameter within its interval (99.7 %)."""
    truth = (2.0, 0.5, 0.1, lead, 0.052)
    time = np.arange(800) * 0.01
    random = np.random.default_rng(5)
    drive = np.repeat(random.choice([-1.0, 1.0], 40), 20)
    bare = make_recording(time, {"valve_V": drive}, "run", "")
    level = simulate(process(*truth), bare, None)[:, 0] + random.normal(0, 0.02, 800)
    recording = make_recording(time, {"valve_V": drive, "level": level}, "run", "")
    found = fit(make_plant("process", "valve_V", ["level"], {}), [recording], [], NONE)
    values = {p.name: p for p in found.plant.parameters}
    if values["time_constant_s"].value < values["second_time_constant_s"].value:  # the two lags may change places
        first, second = values["time_constant_s"], values["second_time_constant_s"]
        values["time_constant_s"], values["second_time_constant_s"] = second, first
    for name, true in zip(NAMES, truth, strict=True):
        low, high = values[name].interval_95
        assert abs(values[name].value - true) < 0.75 * (high - low), name
    assert found.noise["level"] == pytest.approx(0.02, rel=0.1)


def test_a_lag_of_zero_cannot_be_fitted():
    table = {"second_time_constant_s": {"value": 0.0, "free": True}}
    with pytest.raises(IdentifyError, match="a single lag"):
        make_plant("process", "valve_V", ["level"], table)

"""Levels of rest, gears and actuators without memory: simulated as their formulas say, and found again by a fit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy

from firmloop.cli import main
from firmloop.design.design import Request
from firmloop.design.law import DesignError
from firmloop.design.models.model import model_of
from firmloop.identify.error import IdentifyError
from firmloop.identify.fitting.fit import fit
from firmloop.identify.plants.attach import EffectUse, with_effects
from firmloop.identify.plants.kinds import make_plant
from firmloop.identify.plants.plant_table import plant_from_table
from firmloop.identify.recordings.conditioning import NONE, Conditioning
from firmloop.identify.recordings.recording import make_recording
from firmloop.identify.simulation.linearize import linearize
from firmloop.identify.simulation.simulate import simulate
from firmloop.identify.simulation.stepped import SteppedPlant

TIME = np.arange(900.0)
HEATER = np.select([TIME < 100, TIME < 450], [30.0, 60.0], 20.0)
LAGS = {
    "first_order": {"time_constant_s": 40.0},
    "second_order": {"natural_frequency_rad_s": 0.05, "damping_ratio": 0.8},
    "process": {"time_constant_s": 40.0, "second_time_constant_s": 10.0, "zero_time_constant_s": 3.0},
}
MOTOR = {"R_ohm": 2.5, "L_H": 1e-3, "ke_V_s_rad": 0.037, "kt_N_m_A": 0.037, "J_kg_m2": 1.2e-5, "b_N_m_s_rad": 4e-6}


def lag(kind: str, **given: object):
    table = {"gain": 0.6, "delay_s": 14.0, **LAGS[kind], **given}
    return make_plant(kind, "heater_percent", ["temperature_C"], table)


def heated(**columns: np.ndarray):
    return make_recording(TIME, {"heater_percent": HEATER, **columns}, "run.csv", "")


@pytest.mark.parametrize("kind", LAGS)
def test_a_lag_with_levels_of_rest_is_the_lag_of_the_deviations(kind):
    levels = {"output_at_rest": 23.4, "input_at_rest": 30.0}
    found = simulate(lag(kind, **levels), heated(), None)[:, 0]
    away = make_recording(TIME, {"heater_percent": HEATER - 30.0}, "away", "")
    assert found == pytest.approx(23.4 + simulate(lag(kind), away, None)[:, 0], abs=1e-6)
    assert np.all(np.abs(found[:114] - 23.4) < 1e-9)  # nothing moves before the first step has come through


@pytest.mark.parametrize("kind", LAGS)
def test_levels_of_rest_change_nothing_of_the_linear_plant(kind):
    bare, moved = linearize(lag(kind)), linearize(lag(kind, output_at_rest=23.4, input_at_rest=30.0))
    for name in ("a", "b", "c", "d", "delay"):
        assert np.array_equal(getattr(bare, name), getattr(moved, name))


@pytest.mark.parametrize("kind", LAGS)
def test_the_level_of_rest_is_found_with_the_rest(kind):
    random = np.random.default_rng(3)
    truth = lag(kind, output_at_rest=23.4)
    level = simulate(truth, heated(), None)[:, 0] + random.normal(0, 0.05, len(TIME))
    start = lag(kind, output_at_rest=0.0, gain=1.0, delay_s=8.0)
    found = fit(start, [heated(temperature_C=level)], [], NONE)
    for true, parameter in zip(truth.parameters, found.plant.parameters, strict=True):
        low, high = parameter.interval_95
        assert abs(parameter.value - true.value) < 0.75 * (high - low), parameter.name


def test_an_input_at_rest_can_be_what_is_fitted():
    truth = lag("first_order", output_at_rest={"value": 23.4, "free": False}, input_at_rest=30.0)
    level = simulate(truth, heated(), None)[:, 0] + np.random.default_rng(4).normal(0, 0.02, len(TIME))
    start = lag("first_order", output_at_rest={"value": 23.4, "free": False}, input_at_rest=25.0)
    found = {p.name: p for p in fit(start, [heated(temperature_C=level)], [], NONE).plant.parameters}
    assert found["input_at_rest"].value == pytest.approx(30.0, abs=0.05)
    assert found["delay_s"].value == pytest.approx(14.0, abs=0.2)


def test_a_plant_driven_step_by_step_begins_at_rest():
    stepped = SteppedPlant(lag("first_order", output_at_rest=23.4, input_at_rest=30.0), 1.0)
    seen = []
    for _ in range(40):
        seen.append(float(stepped.read()[0]))
        stepped.apply(np.array([30.0]))
    assert seen == pytest.approx([23.4] * 40)


def test_a_law_that_feeds_back_deviations_refuses_a_level():
    request = Request("state_feedback", {}, 1.0, (), ("heater_percent",), lag("first_order", output_at_rest=23.4))
    with pytest.raises(DesignError, match=r"output_at_rest is 23\.4 degC"):
        model_of(request)


def test_a_geared_motor_is_its_equations_at_the_motor():
    plant = make_plant(
        "dc_motor", "voltage_V", ["speed_rad_s", "position_rad", "current_A"], {**MOTOR, "gear_ratio": 20.0}
    )
    time = np.arange(400) * 1e-3
    recording = make_recording(time, {"voltage_V": np.full(400, 12.0)}, "step", "")
    r, inductance, ke, kt, inertia, b = MOTOR.values()
    at_motor = scipy.signal.StateSpace(
        [[-r / inductance, -ke / inductance, 0], [kt / inertia, -b / inertia, 0], [0, 1, 0]],
        [[1 / inductance], [0], [0]], [[0, 1 / 20, 0], [0, 0, 1 / 20], [1, 0, 0]], np.zeros((3, 1)),
    )  # fmt: skip
    _, expected = scipy.signal.step(at_motor, T=time)
    assert simulate(plant, recording, None) == pytest.approx(12.0 * np.asarray(expected), rel=1e-6, abs=1e-9)


def test_friction_of_a_geared_motor_is_met_at_the_output():
    """A Coulomb torque at the output is a twentieth of it at the motor."""
    time = np.arange(400) * 1e-3
    recording = make_recording(time, {"voltage_V": np.full(400, 12.0)}, "step", "")
    geared = make_plant("dc_motor", "voltage_V", ["speed_rad_s"], {**MOTOR, "gear_ratio": 20.0})
    direct = make_plant("dc_motor", "voltage_V", ["speed_rad_s"], MOTOR)
    one = simulate(with_effects(geared, [EffectUse("coulomb_friction", None, {"torque_N_m": 0.04})]), recording, None)
    two = simulate(with_effects(direct, [EffectUse("coulomb_friction", None, {"torque_N_m": 0.002})]), recording, None)
    assert 20.0 * one == pytest.approx(two, rel=1e-6, abs=1e-6)


def test_an_actuator_without_memory_is_found_and_takes_effects():
    random = np.random.default_rng(5)
    duty = random.uniform(-10.0, 10.0, 300)
    force = np.concatenate([[0.0], 2.0 * duty[:-1]]) - 3.0 + random.normal(0, 0.1, 300)
    recording = make_recording(np.arange(300) * 0.1, {"duty": duty, "force_N": force}, "run", "")
    found = fit(make_plant("static", "duty", ["force_N"], {}), [recording], [], NONE).plant
    assert [p.value for p in found.parameters] == pytest.approx([2.0, -3.0], abs=0.03)
    plant = plant_from_table(
        {
            "kind": "static", "input": "duty", "outputs": ["force_N"], "parameters": {"gain": 2.0, "offset": -3.0},
            "effects": [{"name": "dead_zone", "half_width": 4.0}, {"name": "sensor_saturation", "limit_N": 8.0}],
        }
    )  # fmt: skip
    inside = np.sign(duty) * np.maximum(np.abs(duty) - 4.0, 0.0)
    expected = np.clip(2.0 * np.concatenate([inside[:1], inside[:-1]]) - 3.0, -8.0, 8.0)
    assert simulate(plant, recording, None)[:, 0] == pytest.approx(expected)
    assert linearize(plant).d == pytest.approx(np.array([[2.0]]))


@pytest.mark.parametrize("before", ["at rest", "as in the first row"])
def test_the_first_row_of_an_actuator_without_memory_answers_no_input_of_zero(tmp_path, capsys, before):
    """A ramp of a servo pulse begins at 1000 us: a pulse of zero has never been."""
    pulse = 1000.0 + 0.5 * np.arange(400)
    held = np.concatenate([[0.0 if before == "at rest" else pulse[0]], pulse[:-1]])
    force = 3.3e-4 * held - 0.33 + np.random.default_rng(3).normal(0.0, 1e-3, 400)
    rows = [f"{0.02 * k:.2f},{u:g},{y:.6f}" for k, (u, y) in enumerate(zip(pulse, force, strict=True))]
    (tmp_path / "up.csv").write_text("\n".join(["time_s,pulse_us,force_N", *rows, ""]), encoding="utf-8")
    given = 'schema = 1\nname = "esc"\n[recordings]\ntrain = ["up.csv"]\n[plant]\nkind = "static"\ninput = "pulse_us"\n'
    (tmp_path / "p.toml").write_text(given + 'outputs = ["force_N"]\n', encoding="utf-8")
    assert main(["identify", str(tmp_path / "p.toml"), "--out", str(tmp_path / "fit")]) == 0
    assert float(capsys.readouterr().out.partition("rmse ")[2].split()[0]) == pytest.approx(1e-3, rel=0.15)
    fitted = [str(tmp_path / "fit" / "project.toml"), str(tmp_path / "up.csv")]
    assert main(["simulate", *fitted, "--out", str(tmp_path / "sim.csv")]) == 0
    shown = np.genfromtxt(tmp_path / "sim.csv", delimiter=",", names=True)["force_N"]
    assert shown[:2] == pytest.approx([0.0, 0.0], abs=1e-3)


def test_what_follows_an_actuator_without_memory_begins_settled_at_its_first_input():
    duty = np.full(50, 5.0)
    recording = make_recording(np.arange(50) * 0.1, {"duty": duty, "force_N": 0.0 * duty}, "run", "")
    bare = make_plant("static", "duty", ["force_N"], {"gain": 2.0, "offset": -3.0})
    for name, values in (
        ("sensor_lag", {"time_constant_s": 0.7}),
        ("input_delay", {"delay_s": 0.35}),
        ("slew_rate_limit", {"rate_s": 1.0}),
    ):
        plant = with_effects(bare, [EffectUse(name, None, values)])
        assert simulate(plant, recording, None)[:, 0] == pytest.approx(np.full(50, 7.0)), name


def test_a_straight_input_passes_through_its_first_row_and_loses_its_mean():
    duty = 5.0 + np.sin(np.arange(300) * 0.3)
    force = 2.0 * (duty - duty.mean()) - 3.0
    recording = replace(make_recording(np.arange(300) * 0.1, {"duty": duty, "force_N": force}, "r", ""), hold="linear")
    bare = make_plant("static", "duty", ["force_N"], {"gain": 2.0, "offset": -3.0})
    assert simulate(bare, recording, None)[:, 0] == pytest.approx(2.0 * duty - 3.0)
    found = fit(bare, [recording], [], Conditioning(remove_offset=("duty",))).plant
    assert [p.value for p in found.parameters] == pytest.approx([2.0, -3.0])


def test_a_servo_does_not_answer_small_moves_about_the_command_it_rests_at():
    pulse = np.repeat([1500.0, 1530.0, 1600.0, 1400.0, 1475.0], 40)
    recording = make_recording(np.arange(200) * 0.02, {"pulse_us": pulse}, "run", "")
    rest = {"input_at_rest": 1500.0, "output_at_rest": 7.0}
    parameters = {"gain": 0.5, "time_constant_s": 1e-3, "delay_s": 0.0, **rest}
    table = {"kind": "first_order", "input": "pulse_us", "outputs": ["speed_rad_s"], "parameters": parameters}
    plant = plant_from_table({**table, "effects": [{"name": "dead_zone", "half_width": 40.0}]})
    settled = simulate(plant, recording, None)[39::40, 0]
    assert settled == pytest.approx([7.0, 7.0, 7.0 + 0.5 * 60.0, 7.0 - 0.5 * 60.0, 7.0])


def test_what_an_expression_adds_to_an_output_stays_with_effects():
    table = {
        "kind": "ode", "states": ["x"], "inputs": ["u"], "outputs": {"y_V": "2*x + 5"}, "derivatives": {"x": "u - x"},
        "effects": [{"name": "sensor_gain", "gain": 3.0}, {"name": "sensor_lag", "time_constant_s": 1e-4}],
    }  # fmt: skip
    recording = make_recording(np.arange(100) * 0.1, {"u": np.zeros(100)}, "still", "")
    assert simulate(plant_from_table(table), recording, None)[:, 0] == pytest.approx(15.0)


def test_a_key_of_another_kind_is_refused_with_those_there_are():
    with pytest.raises(IdentifyError, match=r"dc_motor has no such parameter; it has .*gear_ratio"):
        make_plant("dc_motor", "voltage_V", ["speed_rad_s"], {**MOTOR, "output_at_rest": 1.0})


def test_a_value_far_below_its_interval_is_printed_as_it_was_fitted(tmp_path, capsys):
    """Noise that neither a gain nor an offset could take up leaves the offset that is there, 10 uN."""
    random = np.random.default_rng(8)
    duty = random.uniform(-10.0, 10.0, 400)
    held, noise = np.concatenate([duty[:1], duty[:-1]]), random.normal(0.0, 0.1, 400)
    shapes = np.column_stack([held, np.ones(400)])[1:]
    noise[1:] -= shapes @ np.linalg.lstsq(shapes, noise[1:], rcond=None)[0]
    force = 2.0 * held + 1e-5 + noise
    rows = [f"{0.1 * k:.1f},{u!r},{y!r}" for k, (u, y) in enumerate(zip(duty.tolist(), force.tolist(), strict=True))]
    (tmp_path / "r.csv").write_text("\n".join(["time_s,duty,force_N", *rows, ""]), encoding="utf-8")
    given = 'schema = 1\nname = "a"\n[recordings]\ntrain = ["r.csv"]\n[plant]\nkind = "static"\ninput = "duty"\n'
    (tmp_path / "p.toml").write_text(given + 'outputs = ["force_N"]\n', encoding="utf-8")
    assert main(["identify", str(tmp_path / "p.toml"), "--out", str(tmp_path / "fit")]) == 0
    assert "offset  1.0e-05" in capsys.readouterr().out


@pytest.mark.parametrize(("commands", "says"), [((-200.0, 200.0), True), ((-200.0, -90.0, 10.0, 60.0, 150.0), False)])
def test_a_curve_without_memory_is_told_by_levels_and_not_by_frequencies(tmp_path, capsys, commands, says):
    command = np.repeat(commands, 200)
    speed = 0.3 * np.clip(np.sign(command) * np.maximum(np.abs(command) - 40.0, 0.0), -130.0, 130.0)
    held = np.concatenate([speed[:1], speed[:-1]]) + np.random.default_rng(5).normal(0.0, 0.5, len(speed))
    rows = [f"{0.1 * k:.1f},{u:g},{y:.5f}" for k, (u, y) in enumerate(zip(command, held, strict=True))]
    (tmp_path / "r.csv").write_text("\n".join(["time_s,command,speed_rad_s", *rows, ""]), encoding="utf-8")
    given = 'schema = 1\nname = "a"\n[recordings]\ntrain = ["r.csv"]\n[plant]\nkind = "static"\ninput = "command"\n'
    more = (
        'outputs = ["speed_rad_s"]\n[[plant.effects]]\nname = "dead_zone"\nhalf_width = { value = 30, free = true }\n'
    )
    (tmp_path / "p.toml").write_text(given + more, encoding="utf-8")
    assert main(["identify", str(tmp_path / "p.toml"), "--out", str(tmp_path / "fit")]) == 0
    said = capsys.readouterr().out
    assert "frequenc" not in said
    assert ("command holds 2 levels, and 3 free parameters of 1 output need 3: record more levels" in said) == says

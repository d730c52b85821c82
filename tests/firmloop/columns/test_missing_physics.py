"""What widens intervals because it is missing from the equations is no reason to record more."""

from __future__ import annotations

import json

import numpy as np
import pytest

from bench.host.identify_faults import heater, noise
from firmloop.cli import main
from tests.firmloop.columns.test_identify_says import identified, logged, seeded, written


def test_intervals_that_missing_friction_widens_are_no_reason_to_record_more(tmp_path, capsys):
    """A shaft that sticks at most levels: harder steps would be missed in the same way."""
    rng, step, fine = seeded(24), 0.02, 20
    drive = np.repeat(rng.choice([-0.5, -0.33, 0.33, 0.36, 0.5], 30), 50)
    speed, w = np.zeros(len(drive)), 0.0
    for k, u in enumerate(drive):
        speed[k] = w
        for _ in range(fine):
            push = 63.5 * u - 2.14 * w
            if w == 0.0 and abs(push) < 19.4:
                continue
            moved = w + step / fine * (push - 19.4 * np.sign(w or push))
            w = 0.0 if moved * w < 0.0 else moved
    position = np.cumsum(speed) * step + noise(rng, len(drive), 0.001)
    parameters = {
        "R_ohm": 5.0,
        "L_H": 0.002,
        "ke_V_s_rad": {"value": 0.3, "free": True},
        "kt_N_m_A": 0.3,
        "J_kg_m2": {"value": 0.003, "free": True},
        "b_N_m_s_rad": 1e-4,
    }
    table = {"kind": "dc_motor", "input": "voltage_V", "outputs": ["position_rad"], "parameters": parameters}
    made = (table, np.arange(len(drive)) * step, {"voltage_V": drive, "position_rad": position})
    says, _ = identified(written(tmp_path / "log", made), capsys)
    assert any("ke_V_s_rad" in each and "ask firmloop diagnose what is missing" in each for each in says), says
    assert not any("excite the plant more" in each or "drive it further" in each for each in says)


def test_white_noise_that_was_smoothed_is_not_taken_for_what_is_missing(tmp_path, capsys):
    table, time, columns = heater(seeded(31))
    (output,) = table["outputs"]
    level = columns[output]
    noisy = {**columns, output: level + noise(seeded(32), len(level), 4.0 * np.std(level))}
    folder = written(tmp_path / "log", (table, time, noisy))
    project = folder / "project.toml"
    smoothed = "[recordings.conditioning]\nsavgol_window = 21\n[plant]"
    project.write_text(project.read_text().replace("[plant]", smoothed, 1))
    says, _ = identified(folder, capsys)
    assert any("known to no better" in each and "drive it further" in each for each in says), says
    assert not any("moves slowly" in each for each in says)


def test_a_sensor_that_reads_too_little_is_said_to_read_less(tmp_path, capsys):
    """A tank empties through a hole in its floor; its sensor shows 30 mm less than there is."""
    time, level = np.arange(0.0, 300.0, 0.5), [0.26]
    for _ in time[1:]:
        level.append(level[-1] - 0.5 * 0.0029 * np.sqrt(max(level[-1], 0.0)))
    shown = np.array(level) - 0.03 + noise(seeded(7), len(time), 2e-4)
    (tmp_path / "p.toml").write_text(
        'schema = 1\nname = "tank"\n[recordings]\ntrain = ["r.csv"]\n'
        '[plant]\nkind = "ode"\nstates = ["level_m"]\ninputs = ["open"]\n'
        '[plant.outputs]\nlevel_m = "level_m"\n'
        '[plant.derivatives]\nlevel_m = "-c*open*sqrt(max(level_m, 0))"\n'
        "[plant.parameters]\nc = { value = 0.002, free = true }\n"
    )
    rows = [f"{t:g},1,{y:.6f}" for t, y in zip(time, shown, strict=True)]
    (tmp_path / "r.csv").write_text("\n".join(["time_s,open,level_m", *rows, ""]))
    assert main(["identify", str(tmp_path / "p.toml"), "--out", str(tmp_path / "fit")]) == 0
    said = capsys.readouterr().out
    assert "level_m reads 0.0" in said and " m less than the plant gives" in said


def test_what_cannot_be_told_from_zero_is_said_once(tmp_path, capsys):
    """A pendulum as a stage without gravity: its inertia may be anything from zero on."""
    step, fine, angle, speed, shown = 0.01, 20, 0.0, 0.0, []
    torque = 1.5 * np.sin(2.6 * np.arange(320) * step) * np.repeat([1.0, -1.0, 1.0, 0.5], 80)
    for push in torque:
        shown.append(angle)
        for _ in range(fine):
            speed += step / fine * (push - 4.1 * np.sin(angle) - 0.03 * speed) / 0.2
            angle += step / fine * speed
    parameters = {"J_kg_m2": {"value": 0.1, "free": True}, "b_N_m_s_rad": {"value": 0.1, "free": True}}
    table = {"kind": "rotary_stage", "input": "torque_N_m", "outputs": ["position_rad"], "parameters": parameters}
    position = np.array(shown) + noise(seeded(2), len(shown), 1e-3)
    made = (table, np.arange(len(torque)) * step, {"torque_N_m": torque, "position_rad": position})
    says, _ = identified(written(tmp_path / "log", made), capsys)
    told = [each for each in says if each.startswith("J_kg_m2")]
    assert len(told) == 1 and "cannot be told from 0" in told[0], says


LOSSES = {
    "radiation": lambda c: 2.2e-9 * ((c + 273.15) ** 4 - 293.15**4),
    "convection": lambda c: 0.25 * np.sign(c - 20.0) * np.abs(c - 20.0) ** 1.25,
    "conduction": lambda c: 0.7 * (c - 20.0),
}


def heated(loss, powers, seed, lag_s=0.0):
    """A body of 200 J/K in a room of 20 degC, its power in W held for 1500 s each and passed through a second lag."""
    drive, celsius, warmth, heater_W = np.repeat(np.array(powers, float), 300), [], 20.0, 0.0
    for power in drive:
        celsius.append(warmth)
        for _ in range(10):
            heater_W = power if lag_s == 0.0 else heater_W + 0.5 * (power - heater_W) / lag_s
            warmth += 0.5 / 200.0 * (heater_W - loss(warmth))
    shown = np.array(celsius) + noise(seeded(seed), len(drive), 0.3)
    given = {"gain": 1.0, "time_constant_s": 200.0, "delay_s": {"value": 0.0, "free": False}, "output_at_rest": 20.0}
    table = {"kind": "first_order", "input": "power_W", "outputs": ["temperature_C"], "parameters": given}
    return table, 5.0 * np.arange(len(drive)), {"power_W": drive, "temperature_C": shown}


def remarks_on(folder, runs, capsys):
    project = written(folder, runs[0]) / "project.toml"
    for k, (_, time, columns) in enumerate(runs):
        logged(folder / f"{k}.csv", time, columns)
    names = json.dumps([f"{k}.csv" for k in range(len(runs))])
    project.write_text(project.read_text().replace('["log.csv"]', names, 1))
    return identified(folder, capsys)[0]


@pytest.mark.parametrize("powers", [[[0, 30, 120, 0]], [[0, 40], [0, 80], [0, 160]], [[0, 50, 150], [0, 100, 0]]])
@pytest.mark.parametrize("loss", LOSSES)
def test_a_loss_that_grows_faster_than_its_level_is_told_and_a_linear_one_is_not(tmp_path, capsys, loss, powers):
    says = remarks_on(tmp_path / "log", [heated(LOSSES[loss], each, k) for k, each in enumerate(powers)], capsys)
    told = [each for each in says if "bends with its level" in each and "ask firmloop diagnose" in each]
    assert len(told) == (loss != "conduction"), says


@pytest.mark.parametrize("powers", [[[0, 30, 120, 0]], [[0, 40], [0, 80], [0, 120]]])
def test_a_second_lag_is_not_taken_for_such_a_loss(tmp_path, capsys, powers):
    runs = [heated(LOSSES["conduction"], each, k, lag_s=80.0) for k, each in enumerate(powers)]
    assert not any("bends with its level" in each for each in remarks_on(tmp_path / "log", runs, capsys))

"""`firmloop init` on columns of other languages, of a thrust stand, and of what moves by itself."""

from __future__ import annotations

import tomllib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from firmloop.cli import main

STEP, ROWS = 0.05, 900
TIME = STEP * np.arange(ROWS)
RANDOM = np.random.default_rng(4)
PULSE = np.repeat(RANDOM.choice([0.0, 20.0, 45.0, 70.0], ROWS // 30), 30)
PULSE[:30] = 0.0


def lagged(drive: np.ndarray, gain: float, lag: float) -> np.ndarray:
    out, stays = np.zeros(len(drive)), np.exp(-STEP / lag)
    for k in range(1, len(drive)):
        out[k] = stays * out[k - 1] + (1.0 - stays) * gain * drive[k - 1]
    return out


Said = Callable[..., tuple[int, str]]


@pytest.fixture
def said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Said:
    """Return what init says of columns of numbers, by their names."""

    def begin(columns: dict[str, np.ndarray], *further: str) -> tuple[int, str]:
        rows = (",".join(f"{value:.7g}" for value in row) for row in zip(*columns.values(), strict=True))
        (tmp_path / "a.csv").write_text("\n".join([",".join(columns), *rows, ""]), encoding="utf-8")
        status = main(["init", str(tmp_path / "a.csv"), "--out", str(tmp_path / "p.toml"), *further])
        shown = capsys.readouterr()
        return status, shown.out + shown.err

    return begin


@pytest.mark.parametrize(
    ("asked", "read"),
    [
        ("referencia", "angulo_deg"),
        ("referência", "ângulo_deg"),
        ("consigna", "posicion_deg"),
        ("Sollwert", "Winkel_deg"),
        ("consigne", "inclinaison_deg"),
        ("riferimento", "angolo_deg"),
        ("setpoint", "tilt_deg"),
    ],
)
def test_a_set_point_of_another_language_is_no_output_and_an_angle_is(asked: str, read: str, said: Said) -> None:
    angle = lagged(PULSE, 0.6, 0.8) + 0.05 * RANDOM.normal(size=ROWS)
    wanted = np.repeat(angle[::60] + 3.0, 60)
    status, shown = said({"tempo_ms": 1e3 * TIME, read: angle, "u_pct": PULSE, asked: wanted})
    assert status == 0 and "u_percent -> position_rad" in shown
    assert f"column {asked} seems to be a reference and is not used" in shown


def test_words_written_as_one_are_taken_apart(said: Said) -> None:
    speed = lagged(PULSE, 5.0, 0.8) + 0.5 * RANDOM.normal(size=ROWS)
    wanted, turned = np.repeat(speed[::60] + 3.0, 60), np.cumsum(speed) * STEP
    drive = {"Sollgeschwindigkeit": wanted, "Motorspannung": PULSE}
    status, shown = said({"Zeit": TIME, **drive, "Position": turned, "Geschwindigkeit": speed})
    assert status == 0 and "voltage_V -> speed_rad_s" in shown
    assert "column Sollgeschwindigkeit seems to be a reference and is not used" in shown


def stand(**other: np.ndarray) -> dict[str, np.ndarray]:
    """Return what a stand for propellers exports."""
    thrust = lagged(PULSE, 0.3, 0.4)
    return {
        "Time (s)": TIME,
        "ESC signal (µs)": 1000.0 + 10.0 * PULSE,
        "AccX (g)": -0.06 + 0.01 * RANDOM.normal(size=ROWS),
        "AccZ (g)": -0.95 + 0.01 * RANDOM.normal(size=ROWS),
        "Torque (N·m)": 1e-4 * thrust + 1e-5 * RANDOM.normal(size=ROWS),
        "Thrust (gf)": thrust + 0.05 * RANDOM.normal(size=ROWS),
        "Voltage (V)": 4.0 - 0.03 * thrust + 0.004 * RANDOM.normal(size=ROWS),
        "Current (A)": 0.2 + 0.1 * thrust + 0.01 * RANDOM.normal(size=ROWS),
        "Vibration (g)": 0.06 + 0.01 * np.abs(RANDOM.normal(size=ROWS)),
        **other,
    }


def test_the_pulse_of_a_stand_is_the_input_and_its_thrust_the_output(said: Said) -> None:
    status, shown = said(stand())
    assert status == 0 and "ESC_signal -> force_N" in shown and "force_N     in gf" in shown
    assert "column Voltage (V) is not used" in shown and "column AccX (g) is not used" in shown


def test_of_three_forces_all_but_the_likeliest_are_to_be_left_out(said: Said) -> None:
    status, shown = said(stand(**{"Thrust 2 (N)": RANDOM.normal(size=ROWS), "Thrust 3 (N)": RANDOM.normal(size=ROWS)}))
    names = "columns 'Thrust (gf)', 'Thrust 2 (N)', 'Thrust 3 (N)' all seem to be force_N"
    left = "say which ones are to be left out: --leave-out 'Thrust 2 (N)' --leave-out 'Thrust 3 (N)'"
    assert status == 2 and f"{names}; {left}" in shown


def test_a_voltage_that_follows_the_duty_is_that_of_the_motor(said: Said) -> None:
    volts = 0.12 * PULSE
    columns = {"t": TIME, "pwm": PULSE, "voltage_V": volts, "w_rad_s": lagged(volts, 20.0, 0.5)}
    assert "voltage_V -> speed_rad_s" in said(columns)[1]


def test_of_a_free_decay_init_says_what_to_write_instead(said: Said) -> None:
    status, shown = said({"t_s": TIME, "hole_open": np.ones(ROWS), "level_m": 0.2 * np.exp(-TIME / 9.0)})
    assert status == 2 and "init cannot tell what moves by itself" in shown
    assert "write its project by hand, with hole_open as plant.input" in shown


@pytest.mark.parametrize(
    ("pump", "scale"), [("pump_pct", "scale_kg"), ("Pumpe [%]", "Gewicht [g]"), ("u_pct", "tank [lb]")]
)
def test_what_stands_on_a_scale_is_no_force_that_moves_the_plant(pump: str, scale: str, said: Said) -> None:
    mass = 2.0 + lagged(PULSE, 0.2, 0.8) + 0.01 * RANDOM.normal(size=ROWS)
    status, shown = said({"t_s": TIME, pump: PULSE, scale: mass})
    assert status == 0 and "first_order" in shown and "_percent -> " in shown and "_kg" in shown
    assert "force" not in shown


def test_a_thrust_in_grams_is_a_force(said: Said) -> None:
    status, shown = said({"t_s": TIME, "esc_us": 1000.0 + PULSE, "thrust [g]": lagged(PULSE, 9.0, 0.8)})
    assert status == 0 and "-> force_N" in shown


@pytest.mark.parametrize("flag", ["torque_enabled", "force_on", "torque_limit_active", "current_status"])
def test_a_flag_is_none_of_the_quantity_that_it_names(flag: str, said: Said) -> None:
    columns = {"t_s": TIME, flag: 1.0 * (TIME > 2.0), "out": PULSE, "w_rad_s": lagged(PULSE, 20.0, 0.5)}
    status, shown = said(columns)
    assert status == 0 and "out -> speed_rad_s" in shown and f"column {flag} is not used" in shown


def test_no_output_is_taken_for_the_input_where_the_input_never_changes(said: Said) -> None:
    """Both were called temperature_C then, and the file was refused for it."""
    first = 20.0 + lagged(PULSE, 0.5, 1.0)
    columns = {"t_s": TIME, "heater_percent": 0.0 * TIME, "temp1_C": first, "temp2_C": lagged(first, 1.0, 2.0)}
    status, shown = said(columns)
    assert status == 2 and "heater_percent, called as what drives a plant is, never changes" in shown
    del columns["heater_percent"]
    status, shown = said(columns)
    assert status == 0 and "temperature_C -> temp2_C" in shown


@pytest.mark.parametrize(("gain", "rest"), [(2.0, 0.0), (-0.8, 66.0)])
def test_the_reference_of_a_first_project_is_one_that_can_be_held(
    gain: float, rest: float, said: Said, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A measurement goes farther than a reference may: it overshoots, and is noisy."""
    output = rest + lagged(PULSE, gain, 0.8) + np.random.default_rng(1).normal(0.0, 0.2, ROWS)
    assert said({"time_s": TIME, "fan_percent": PULSE, "temperature_C": output})[0] == 0
    signals = tomllib.loads((tmp_path / "p.toml").read_text())["signals"]
    ends = sorted(rest + gain * signals["output"][end] for end in ("low", "high"))
    near, reference = 0.02 * (ends[1] - ends[0]), signals["reference"]
    assert abs(reference["low"] - ends[0]) < near and abs(reference["high"] - ends[1]) < near
    assert signals["measurement"]["high"] > reference["high"]
    assert main(["design", str(tmp_path / "p.toml"), "--out", str(tmp_path / "out")]) == 0
    assert "never reached" not in (shown := capsys.readouterr().out) and "reference not reached" not in shown


@pytest.mark.parametrize("counter", ["Index", "No.", "header.seq", "header.stamp"])
def test_a_number_of_the_row_and_a_second_clock_are_no_signals(counter: str, said: Said) -> None:
    """The row's number of a recorder was taken for what answers the input."""
    counts = 5e7 * np.arange(ROWS) if counter.endswith("stamp") else np.arange(ROWS) + 1.0
    status, told = said({"time_s": TIME, counter: counts, "CH1V": PULSE, "CH2V": lagged(PULSE, 0.1, 2.0)})
    assert status == 0, told
    assert "plant: first_order, CH1_V -> CH2_V" in told
    assert f"column {counter} is not used" in told

"""What a plant leaves may be more than noise can be: then something is missing, whatever a noise model foresees."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from firmloop.diagnose.model.candidate import Candidate
from firmloop.diagnose.model.fit import Fitted
from firmloop.diagnose.model.hypothesis import first_point
from firmloop.diagnose.search.found import Search
from firmloop.diagnose.verdict import refused
from firmloop.identify.fitting.noise import Noise
from firmloop.identify.recordings.recording import make_recording, write_recording
from tests.diagnose.cases import lag_project, lagged, problem_of, said_of

DUCT = """schema = 1
name = "duct"
[recordings]
train = ["train.csv"]
[plant]
kind = "first_order"
input = "heater_V"
outputs = ["temperature_C"]
[plant.parameters]
gain = 2.0
time_constant_s = 1.5
output_at_rest = 22.0
"""
COIL = """schema = 1
name = "coil"
[recordings]
train = ["train.csv"]
[plant]
kind = "ode"
states = ["i_A"]
inputs = ["voltage_V"]
[plant.outputs]
current_A = "i_A"
[plant.derivatives]
i_A = "(voltage_V - R_ohm*i_A) / L_H"
[plant.parameters]
R_ohm = 3.0
L_H = 0.3
"""


def recorded(folder: Path, text: str, **columns: np.ndarray) -> Path:
    """Write a project and its recording, with a clock of 10 ms for whatever time it takes."""
    time = np.arange(len(next(iter(columns.values())))) * 0.01
    write_recording(make_recording(time, columns, "train.csv", ""), folder / "train.csv")
    (folder / "project.toml").write_text(text, encoding="utf-8")
    return folder / "project.toml"


@pytest.mark.parametrize(("slow", "verdict"), [(0.0, "no_mismatch"), (0.5, "unknown_physics")])
def test_a_second_way_for_the_heat_is_said_to_be_missing(slow: float, verdict: str, tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    drive = np.repeat(rng.uniform(0.0, 5.0, 30), 100)
    readings = 22.0 + 2.2 * lagged(drive, 1.2) + slow * lagged(drive, 15.0) + 0.01 * rng.standard_normal(len(drive))
    said = said_of(recorded(tmp_path, DUCT, heater_V=drive, temperature_C=readings))
    assert said["verdict"] == verdict
    assert any("times the sensors' noise" in line for line in said["says"]) == (verdict == "unknown_physics")


@pytest.mark.parametrize(
    ("drop", "rms", "unlike"),
    [
        pytest.param(1500.0, 1.3, True, id="whiter by far, and further off"),
        pytest.param(70.0, 1.3, False, id="as much as a slow disturbance gives"),
        pytest.param(1500.0, 0.9, False, id="nearer, and refused for another reason"),
    ],
)
def test_what_only_whitens_far_more_than_noise_would_let_it_is_no_noise(
    drop: float, rms: float, unlike: bool, tmp_path: Path
) -> None:
    drive = np.repeat([1.0, 0.0, 2.0], 50)
    problem = problem_of(recorded(tmp_path, DUCT, heater_V=drive, temperature_C=22.0 + 2.0 * lagged(drive, 1.5)))
    fitted = Fitted((), (), first_point(problem, problem.train), (), 0.0, (), np.zeros((0, 0)))
    nominal, tried = (
        Candidate(fitted, (Noise(np.zeros(0), size, size),), score) for size, score in ((1.0, 0.0), (rms, -drop))
    )
    assert refused(Search(problem, nominal, nominal, ((tried,),), (), ())) == unlike
    as_white = replace(nominal, likelier=replace(tried, score=-drop + 70.0))
    assert not refused(Search(problem, as_white, as_white, ((tried,),), (), ()))


def test_steps_of_a_sensor_wider_than_noise_may_be_are_all_that_is_missing(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    drive = np.repeat(rng.uniform(0.0, 5.0, 30), 100)
    readings = np.round((22.0 + 2.2 * lagged(drive, 1.2) + 0.01 * rng.standard_normal(len(drive))) / 2.0) * 2.0
    said = said_of(recorded(tmp_path, DUCT, heater_V=drive, temperature_C=readings))
    assert (said["verdict"], [each["name"] for each in said["effects"]]) == ("explained", ["sensor_quantization"])


def test_iron_that_saturates_is_found_in_equations_that_name_no_balance(tmp_path: Path) -> None:
    rng = np.random.default_rng(5)
    drive = np.repeat(rng.uniform(-20.0, 20.0, 60), 20)
    current = np.zeros(len(drive))
    for k in range(1, len(drive)):
        i = current[k - 1]
        for _ in range(20):  # half of L is left at 4 A
            i += 0.0005 * (drive[k - 1] - 3.0 * i) * (1.0 + (i / 4.0) ** 2) / 0.3
        current[k] = i
    readings = current + 0.02 * rng.standard_normal(len(drive))
    said = said_of(recorded(tmp_path, COIL, voltage_V=drive, current_A=readings))
    assert [each["name"] for each in said["effects"]] == ["inductance_saturation"]


PUMP = lag_project("pump_V", "pressure_kPa", 6.0, 4.0, ("4.csv", "12.csv"))


def test_what_answers_an_input_that_nobody_controls_is_no_disturbance(tmp_path: Path) -> None:
    """A pump that begins at 2.5 V, and sucks, too; its tank drains more slowly than it fills, which no effect says."""
    rng, time = np.random.default_rng(3), np.arange(0.0, 50.0, 0.2)
    for top in (4, 12):
        drive = np.where((time >= 1.0) & (time < 26.0), float(top), 0.0) - np.where(time >= 45.0, 3.0, 0.0)
        pressure, read = 0.0, []
        for each in drive:
            read.append(pressure)
            for _ in range(20):
                pumped = 3.0 * (max(each - 2.5, 0.0) + min(each + 2.5, 0.0))
                pressure += 0.01 * (pumped - (0.12 if each == 0.0 else 0.3) * pressure)
        columns = {"pump_V": drive, "pressure_kPa": np.array(read) + rng.normal(0.0, 0.05, len(time))}
        write_recording(make_recording(time, columns, f"{top}.csv", ""), tmp_path / f"{top}.csv")
    (tmp_path / "project.toml").write_text(PUMP, encoding="utf-8")
    said = said_of(tmp_path / "project.toml")
    assert "dead_zone" in {each["name"] for each in said["effects"]}, said["says"]
    for told in ("not the whole of it", "in the balance of pressure_kPa"):
        assert any(told in each for each in said["says"])


@pytest.mark.parametrize("speed", [73.9, 72.9])
def test_counts_that_alternate_from_row_to_row_are_an_encoder_and_no_wave_in_the_drive(
    speed: float, tmp_path: Path
) -> None:
    """Some eighteen and a half counts a row: read as a wave, it had a torque change sides nearly 25 times a second."""
    time = 0.02 * np.arange(301)
    turned = speed * (time - 0.06 * (1.0 - np.exp(-time / 0.06)))
    counted = np.diff(np.floor(turned / 0.0798)) * 0.0798 / 0.02
    table = np.column_stack([time[:-1], np.full(300, 255.0), counted])
    np.savetxt(tmp_path / "log.csv", table, delimiter=",", header="time_s,pwm,speed_rad_s", comments="", fmt="%.7g")
    (tmp_path / "project.toml").write_text(lag_project("pwm", "speed_rad_s", 0.3, 0.1), encoding="utf-8")
    said = said_of(tmp_path / "project.toml")
    assert {each["name"] for each in said["effects"]} <= {"sensor_quantization"}
    assert said["verdict"] in ("no_mismatch", "explained")

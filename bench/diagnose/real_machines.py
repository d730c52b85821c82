"""List the real machines, their linear nominal plants, and the figure by which each is judged."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bench.diagnose.scored import command, simulated_rms
from firmloop.identify.recordings.recording import Recording, make_recording, read_recording, write_recording
from firmloop.stages.prediction import as_recorded

Array = NDArray[np.float64]

ROOT = Path(os.environ.get("FIRMLOOP_RECORDINGS") or Path(__file__).resolve().parents[3] / "shared" / "recordings")
_PWM_FULL = 885.0  # of the XL330 servo
_TICKS = 4096.0 / (2.0 * np.pi)  # per rad, of its encoder


@dataclass(frozen=True, slots=True)
class Machine:
    """One bench: its recordings, its linear nominal plant as text, and the figure that is judged.

    `score` takes (project, recordings, folder) and returns a rms in `unit`; it is to be at most `bar`. `wanted` lists
    effects of which one must be named, `unwanted` those of which none may be. `plant` is empty where the folder of the
    recordings holds the project, `file`.
    """

    name: str
    train: tuple[str, ...]
    test: tuple[str, ...]
    plant: str
    unit: str
    bar: float
    wanted: tuple[str, ...]
    unwanted: tuple[str, ...]
    prepare: Callable[[Path, Path], None]
    score: Callable[[Path, Sequence[Path], Path], float]
    file: str = "project.toml"
    judged: tuple[str, ...] = ()  # files; none means those of test

    @property
    def label(self) -> str:
        """The folder, and the project where it has several."""
        return self.name if self.file == "project.toml" else f"{self.name}/{self.file.removesuffix('.toml')}"


def linked(source: Path, folder: Path) -> None:
    """Use the files as they are."""
    for path in source.glob("*.csv*"):
        (folder / path.name).unlink(missing_ok=True)
        (folder / path.name).symlink_to(path.resolve())


def with_gain(source: Path, folder: Path) -> None:
    """Write the gain of the servo's own controller beside each recording; meta.json holds it."""
    for entry in json.loads((source / "meta.json").read_text())["files"]:
        recording = read_recording(source / entry["file"], {})
        gain = np.full(len(recording.time), entry["kp"] / 256.0 * _TICKS / _PWM_FULL)
        write_recording(
            make_recording(recording.time, {**recording.columns, "duty_per_rad": gain}, recording.source, ""),
            folder / entry["file"],
        )


def simulated(project: Path, recording: Path, folder: Path) -> tuple[Recording, Recording]:
    """Return a recording and its prediction by the command line, the initial state fitted."""
    out = folder / "predicted.csv"
    status, said, _ = command("simulate", project, recording, "--out", out, "--fit-initial")
    if status:
        raise SystemExit(said)
    return read_recording(recording, {}), read_recording(out, {})


def whole(output: str, factor: float) -> Callable[[Path, Sequence[Path], Path], float]:
    """Score one output over all of the recordings, times `factor`."""

    def score(project: Path, recordings: Sequence[Path], folder: Path) -> float:
        lefts = []
        for path in recordings:
            real, ours = simulated(project, path, folder)
            lefts.append(real.columns[output] - ours.columns[output])
        return factor * rms(np.concatenate(lefts))

    return score


def windowed(output: str, factor: float, seconds: float) -> Callable[[Path, Sequence[Path], Path], float]:
    """Score one output over windows, each a recording of its own."""

    def score(project: Path, recordings: Sequence[Path], folder: Path) -> float:
        lefts = []
        for path in recordings:
            real = read_recording(path, {})
            count = round((real.time[-1] - real.time[0]) / seconds)
            for rows in np.array_split(np.arange(len(real.time)), count):
                part = {name: column[rows] for name, column in real.columns.items()}
                write_recording(make_recording(real.time[rows], part, "window", ""), folder / "window.csv")
                one, ours = simulated(project, folder / "window.csv", folder)
                lefts.append(one.columns[output] - ours.columns[output])
        return factor * rms(np.concatenate(lefts))

    return score


def free(output: str) -> Callable[[Path, Sequence[Path], Path], float]:
    """Score one output by the recording where it is worst, from the input alone, the initial state fitted."""

    def score(project: Path, recordings: Sequence[Path], folder: Path) -> float:
        return max(simulated_rms(project, [path], as_recorded)[output] for path in recordings)

    return score


def rms(values: Array) -> float:
    """Return the root mean square."""
    return float(np.sqrt(np.mean(values**2)))


EMPS = """
kind = "linear_stage"
input = "force_N"
outputs = ["position_m"]
[plant.parameters]
mass_kg = { value = 100.0, free = true }
b_N_s_m = { value = 250.0, free = true }
"""

SILVERBOX = """
kind = "ode"
states = ["x_V", "v_V_s"]
inputs = ["voltage_V"]
[plant.outputs]
output_V = "x_V"
[plant.derivatives]
x_V = "v_V_s"
v_V_s = "(voltage_V - d*v_V_s - k*x_V) / m"
[plant.balances]
v_V_s = { kind = "force", per = "1/m", position = "x_V", speed = "v_V_s", effort = "voltage_V" }
[plant.parameters]
m = { value = 5e-6, free = true }
d = { value = 2e-4, free = true }
k = { value = 1.0, free = true }
"""

TANKS = """
kind = "ode"
states = ["upper_V", "lower_V"]
inputs = ["pump_voltage_V"]
[plant.outputs]
level_sensor_V = "lower_V"
[plant.derivatives]
upper_V = "k4*pump_voltage_V - k1*sqrt(upper_V)"
lower_V = "k2*sqrt(upper_V) - k3*sqrt(lower_V)"
[plant.balances]
upper_V = { kind = "flow", to = "lower_V" }
lower_V = { kind = "flow" }
[plant.parameters]
k1 = { value = 0.05, free = true, low = 0.0 }
k2 = { value = 0.05, free = true, low = 0.0 }
k3 = { value = 0.05, free = true, low = 0.0 }
k4 = { value = 0.05, free = true, low = 0.0 }
"""

# The position controller runs in the servo itself: duty = gain * error, up to the whole supply.
_TORQUE = """kt_N_m_A/R_ohm*torque_enable\
*(supply_voltage_V*max(-1, min(1, duty_per_rad*(position_ref_rad - position_rad))) - kt_N_m_A*speed_rad_s)"""

SERVO = f"""
kind = "ode"
states = ["position_rad", "speed_rad_s"]
inputs = ["position_ref_rad", "supply_voltage_V", "duty_per_rad", "torque_enable"]
[plant.outputs]
position_rad = "position_rad"
[plant.derivatives]
position_rad = "speed_rad_s"
speed_rad_s = "({_TORQUE} - b_N_m_s_rad*speed_rad_s - 0.49*9.81*0.1*sin(position_rad)) / J_kg_m2"
[plant.balances.speed_rad_s]
kind = "torque"
per = "1/J_kg_m2"
position = "position_rad"
effort = "{_TORQUE}"
[plant.parameters]
kt_N_m_A = {{ value = 0.4, free = true, low = 0.01 }}
R_ohm = {{ value = 4.0, free = false }}
b_N_m_s_rad = {{ value = 0.02, free = true, low = 0.0 }}
J_kg_m2 = {{ value = 0.006, free = true, low = 0.001 }}
"""

HOOP = """
kind = "first_order"
input = "motor_cmd_norm"
outputs = ["tacho_V"]
[plant.parameters]
gain = { value = 12.0, free = true }
time_constant_s = { value = 1.5, free = true }
delay_s = { value = 0.0, free = false }
"""

QUBE = """
kind = "ode"
states = ["arm_position_rad", "pendulum_position_rad", "arm_speed_rad_s", "pendulum_speed_rad_s"]
inputs = ["voltage_V"]
[plant.outputs]
arm_position_rad = "arm_position_rad"
pendulum_position_rad = "pendulum_position_rad"
[plant.derivatives]
arm_position_rad = "arm_speed_rad_s"
pendulum_position_rad = "pendulum_speed_rad_s"
arm_speed_rad_s = "g*voltage_V - d*arm_speed_rad_s + c*pendulum_position_rad"
pendulum_speed_rad_s = "w2*pendulum_position_rad + h*(g*voltage_V - d*arm_speed_rad_s) - e*pendulum_speed_rad_s"
[plant.balances]
arm_speed_rad_s = { kind = "torque", per = "1", position = "arm_position_rad", effort = "g*voltage_V" }
[plant.parameters]
g = { value = 50.0, free = true }
d = { value = 15.0, free = true }
c = { value = 150.0, free = true }
w2 = { value = 260.0, free = true }
h = { value = 1.0, free = true }
e = { value = 1.0, free = true }
"""

_TRIED = ("sin_sin", "lift_and_drop", "up_and_down", "sin_time_square")
_SERVO_TRAIN = tuple(f"kp{gain}_{kind}.csv.gz" for gain in (100, 400) for kind in _TRIED)
_SERVO_TEST = tuple(f"kp{gain}_{kind}.csv.gz" for gain in (200, 800) for kind in _TRIED)
_QUBE_FILES = tuple(sorted(path.name for path in (ROOT / "qube_servo_pendulum").glob("*.csv.gz")))

MACHINES = (
    Machine(
        "emps", ("train.csv.gz",), ("test_pulses.csv.gz",), EMPS, "mm", 0.20,
        ("asymmetric_friction", "coulomb_friction"), (), linked, windowed("position_m", 1e3, 0.5),
    ),
    Machine(
        "silverbox", ("multisine_train.csv.gz",), ("arrow_test.csv.gz",), SILVERBOX, "mV", 0.31,
        ("hardening_spring",), (), linked, whole("output_V", 1e3),
    ),
    Machine(
        "cascaded_tanks", ("train.csv",), ("test.csv",), TANKS, "V", 0.33,
        ("overflow",), (), linked, whole("level_sensor_V", 1.0),
    ),
    Machine(
        "dynamixel_xl330_pendulum",
        _SERVO_TRAIN, _SERVO_TEST,
        SERVO, "rad", 0.085, ("load_dependent_friction",), (), with_gain, whole("position_rad", 1.0),
    ),
    Machine(
        "ball_and_hoop_dc_motor", ("randomStepSequence.csv",), ("fixedStepSequence.csv",), HOOP, "V", 0.30,
        ("quadratic_drag",), ("coulomb_friction",), linked, whole("tacho_V", 1.0),
    ),
    Machine(
        "qube_servo_pendulum", _QUBE_FILES[5:7], _QUBE_FILES[8:9], QUBE, "rad", np.inf,
        (), ("quadratic_drag", "backlash", "end_stop", "gravity_torque"), linked,
        windowed("arm_position_rad", 1.0, 0.2),
    ),
    Machine(
        "lab_dc_motor_dead_time", ("r1.csv",), ("r3.csv",), "", "rad/s", 3.0, (), (), linked, free("speed_rad_s"),
    ),
    Machine(
        "lab_dc_motor_dead_time", ("r2.csv",), ("r4.csv",), "", "rad/s", 5.0, (), (), linked, free("speed_rad_s"),
        "brake.toml", ("r2.csv",),
    ),
    Machine(
        "two_motor_rig", ("pos_0p065_1.csv.gz", "pos_0p06_1.csv.gz"), ("pos_0p065_3.csv.gz", "pos_0p06_3.csv.gz"), "",
        "rad/s", 14.0, ("coulomb_friction", "load_torque"), (), linked, free("speed_rad_s"), "forward.toml",
    ),
    Machine(
        "two_motor_rig",
        ("neg_0p045_1.csv.gz", "neg_0p04_1.csv.gz", "pos_0p065_1.csv.gz", "pos_0p06_1.csv.gz"),
        ("neg_0p045_3.csv.gz", "neg_0p04_3.csv.gz", "pos_0p065_3.csv.gz", "pos_0p06_3.csv.gz"), "",
        "rad/s", np.inf, ("asymmetric_friction", "coulomb_friction"), (), linked, free("speed_rad_s"),
    ),
    Machine(
        "flexible_ruler_arm", ("c_swept1_0_10hz.csv.gz", "c_step1.csv.gz"),
        ("c_swept2_0_10hz.csv.gz", "c_step2.csv.gz"), "", "rad", 0.030, ("flexible_coupling",), (), linked,
        free("position_rad"),
    ),
    Machine(
        "servo_axis_friction", ("d1.csv.gz",), ("d5.csv.gz",), "", "rad/s", 5.6, ("coulomb_friction",), (), linked,
        free("speed_rad_s"),
    ),
    Machine(
        "heater_lab", ("r1.csv.gz",), ("r2.csv.gz",), "", "K", 0.52, ("sensor_lag",), (), linked,
        free("temperature_C"),
    ),
)  # fmt: skip

"""Closed-loop recordings of a small motor under a PID that is written here once more, with a fault on request."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

Array = NDArray[np.float64]

MOTOR = {"R_ohm": 2.0, "L_H": 2e-3, "ke_V_s_rad": 0.05, "kt_N_m_A": 0.05, "J_kg_m2": 2e-5, "b_N_m_s_rad": 2e-5}
GAINS = {"kp": 0.05, "ki": 1.2, "kd": 2e-4, "tf_s": 2e-3, "b": 0.8, "u_min": -4.0, "u_max": 4.0}
PERIOD = 1e-3


@dataclass(frozen=True)
class Firmware:
    """What the firmware really does; the default is what the project says."""

    gains: Mapping[str, float] = field(default_factory=dict)
    limit: float = 4.0
    leaky: bool = False  # the output alone is not limited
    windup: bool = True  # it tracks its limits
    late: int = 0  # samples by which the command comes late
    late_input: int = 0  # samples by which the measurement does
    every: int = 1  # rows of a millisecond per step
    scale: float = 1.0  # of the measurement
    sign: float = 1.0  # of the recorded command
    friction: float = 0.0  # N m, of the motor


def record(rows: int, seed: int, made: Firmware, digits: int = 6, step: float = 0.0, skip: int = 0) -> dict[str, Array]:
    """Return columns; `step` is the resolution of the speed, rad/s; the first `skip` rows are not recorded."""
    random = np.random.default_rng(seed)
    count = rows // 250 + 3
    stairs = random.uniform(40.0, 100.0, count) * (-1.0) ** np.arange(count)  # some too far: the output saturates
    reference = np.repeat(stairs, 250)[: rows + skip]
    p = {**GAINS, **made.gains}
    h = PERIOD
    tt = max(np.sqrt(p["kd"] / p["ki"]) if p["kd"] else p["kp"] / p["ki"], h)
    resistance, inductance, ke, kt, inertia, viscous = MOTOR.values()
    a = np.zeros((4, 4))  # current, speed, voltage, torque
    a[0, :3] = np.array([-resistance, -ke, 1.0]) / inductance
    a[1] = np.array([kt, -viscous, 0.0, -1.0]) / inertia
    parts = 10
    move = expm(a * h / parts)
    current = speed = integral = derivative = last = 0.0
    seen, told, measured, amps = [], [], [], []
    queue = [0.0] * made.late
    heard: list[float] = []
    u = 0.0
    for k in range(rows + skip):
        y = speed + random.normal(0.0, 0.3)
        y = round(y / step) * step if step else y
        y = float(f"{y:.{digits}g}")
        amps.append(float(f"{current + random.normal(0.0, 0.02):.{digits}g}"))
        heard.append(y)
        if k % made.every == 0:
            own = made.scale * heard[max(k - made.late_input, 0)]
            error = reference[k] - own
            x = p.get("c", 0.0) * reference[k] - own
            if k:
                derivative = p["tf_s"] / (p["tf_s"] + h) * derivative + p["kd"] / (p["tf_s"] + h) * (x - last)
            last = x
            free = p["kp"] * (p["b"] * reference[k] - own) + integral + derivative
            limited = min(max(free, -made.limit), made.limit)
            integral += p["ki"] * h * error + (h / tt * (limited - free) if made.windup else 0.0)
            queue.append(free if made.leaky else limited)
            u = queue.pop(0)
        told.append(float(f"{made.sign * u:.{digits}g}"))
        seen.append(reference[k])
        measured.append(y)
        for _ in range(parts):
            against = made.friction * np.sign(speed)
            if made.friction and abs(speed) < 0.5 and abs(0.05 * current) < made.friction:
                against = 0.05 * current
            current, speed, _, _ = move @ np.array([current, speed, u, against])
    columns = {
        "reference_rad_s": np.array(seen),
        "voltage_V": np.array(told),
        "speed_rad_s": np.array(measured),
        "current_A": np.array(amps),
    }
    return {name: values[skip:] for name, values in columns.items()}


def project(folder: Path, made: Firmware, controller: str = "", rows: int = 3000, **how: float) -> Path:
    """Write a project with two such recordings; return its file."""
    folder.mkdir(parents=True, exist_ok=True)
    for role, seed, length in (("train", 1, rows), ("test", 2, 2 * rows // 3)):
        columns = record(length, seed, made, **how)  # type: ignore[arg-type]
        time = np.arange(len(columns["voltage_V"])) * PERIOD
        lines = [",".join(("time_s", *columns))]
        lines += [",".join(f"{x:.9g}" for x in row) for row in zip(time, *columns.values(), strict=True)]
        (folder / f"{role}.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    parameters = "\n".join(f"{name} = {{ value = {value}, free = true }}" for name, value in MOTOR.items())
    gains = controller or "\n".join(f"{name} = {value}" for name, value in GAINS.items())
    (folder / "project.toml").write_text(
        f"""schema = 1
name = "wheel"
[recordings]
train = ["train.csv"]
test = ["test.csv"]
[plant]
kind = "dc_motor"
input = "voltage_V"
outputs = ["speed_rad_s", "current_A"]
[plant.parameters]
{parameters}
[controller]
kind = "pid"
period_s = {PERIOD}
{gains}
[signals]
reference = {{ unit = "rad/s", low = -400, high = 400 }}
measurement = {{ unit = "rad/s", low = -400, high = 400 }}
output = {{ unit = "V", low = -12, high = 12 }}
[arithmetic]
number = "float32"
""",
        encoding="utf-8",
    )
    return folder / "project.toml"

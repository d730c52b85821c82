"""Draw linear plants and move them exactly, from rest, by matrix exponentials."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

Array = NDArray[np.float64]
Matrices = tuple[Array, Array, Array, Array]


@dataclass(frozen=True, slots=True)
class Linear:
    """A plant x' = A x + B u, y = C x + D u (n; r), and the text of its `[plant]` with true parameters."""

    table: str  # all of [plant] but its parameters
    parameters: Mapping[str, float]
    held: Sequence[str]  # parameters that a user knows
    matrices: Matrices
    input: str
    outputs: Sequence[str]
    top: float  # largest input
    step: float  # s, a row


def drawn_motor(rng: np.random.Generator) -> Linear:
    """Draw a motor and what is seen of it."""
    resistance, constant = 10.0 ** rng.uniform(-0.5, 1.2), 10.0 ** rng.uniform(-2.0, -0.8)
    mechanical, electrical = rng.uniform(0.02, 0.2), rng.uniform(1e-3, 4e-3)  # s
    inertia = mechanical * constant**2 / resistance
    damping = rng.uniform(0.01, 0.3) * constant**2 / resistance
    values = {
        "R_ohm": resistance, "L_H": electrical * resistance, "ke_V_s_rad": constant, "kt_N_m_A": constant,
        "J_kg_m2": inertia, "b_N_m_s_rad": damping,
    }  # fmt: skip
    sensors = (("speed_rad_s", "current_A"), ("position_rad", "current_A"), ("speed_rad_s",))[int(rng.integers(3))]
    held = ("kt_N_m_A",) if "current_A" in sensors else ("L_H", "kt_N_m_A", "R_ohm")
    made = motor_matrices(values, sensors)
    return Linear('kind = "dc_motor"', values, held, made, "voltage_V", sensors, 12.0, 1e-3)


def motor_matrices(values: Mapping[str, float], outputs: Sequence[str]) -> Matrices:
    """Return the matrices of a motor: current, speed, position."""
    resistance, inductance, emf, torque, inertia, damping = (values[name] for name in _MOTOR)
    a = np.array([
        [-resistance / inductance, -emf / inductance, 0.0], [torque / inertia, -damping / inertia, 0.0],
        [0.0, 1.0, 0.0],
    ])  # fmt: skip
    place = {"current_A": 0, "speed_rad_s": 1, "position_rad": 2}
    return a, np.array([1.0 / inductance, 0.0, 0.0]), np.eye(3)[[place[k] for k in outputs]], np.zeros(len(outputs))


_MOTOR = ("R_ohm", "L_H", "ke_V_s_rad", "kt_N_m_A", "J_kg_m2", "b_N_m_s_rad")


def drawn_stage(rng: np.random.Generator) -> Linear:
    """Draw a body on a bearing, rotary or linear, and what is seen of it."""
    linear = bool(rng.integers(2))
    names, unit = (("mass_kg", "b_N_s_m"), "m") if linear else (("J_kg_m2", "b_N_m_s_rad"), "rad")
    body = 10.0 ** (rng.uniform(-0.5, 1.5) if linear else rng.uniform(-5.0, -2.0))
    damping = body / rng.uniform(0.03, 0.5)
    sensors = ((f"position_{unit}",), (f"position_{unit}", f"speed_{unit}_s"), (f"speed_{unit}_s",))
    shown = sensors[int(rng.integers(3))]
    values = dict(zip(names, (body, damping), strict=True))
    kind, drive = ("linear_stage", "force_N") if linear else ("rotary_stage", "torque_N_m")
    made = stage_matrices(values, shown)
    return Linear(f'kind = "{kind}"', values, (), made, drive, shown, 20.0 * damping, 2e-3)


def stage_matrices(values: Mapping[str, float], outputs: Sequence[str]) -> Matrices:
    """Return the matrices of a body on a bearing: speed, position."""
    body, damping = values.values()
    a = np.array([[-damping / body, 0.0], [1.0, 0.0]])
    c = np.eye(2)[[int(name.startswith("position")) for name in outputs]]
    return a, np.array([1.0 / body, 0.0]), c, np.zeros(len(outputs))


def moved(matrices: Matrices, step: float, drive: Array) -> Array:
    """Return the outputs (n, r) from rest; `drive` (n,) is held row by row."""
    a, b, c, d = matrices
    n = len(b)
    both = np.zeros((n + 1, n + 1))
    both[:n, :n], both[:n, n] = a, b
    over = expm(both * step)
    by_state, by_input = over[:n, :n], over[:n, n]
    x, states = np.zeros(n), np.zeros((len(drive), n))
    for k, u in enumerate(drive):
        states[k] = x
        x = by_state @ x + by_input * u
    return np.asarray(states @ c.T + np.outer(drive, d))


def project_text(plant: Linear, count: int, rng: np.random.Generator) -> str:
    """Give nominal parameters that are off by up to 10 %, free but for those that a user knows."""
    lines = ["schema = 1", 'name = "hidden"', "[recordings]"]
    lines += [f"train = {json.dumps([f'train_{k + 1}.csv' for k in range(count)])}", "[plant]"]
    ode = plant.table.startswith('kind = "ode"')
    lines += [] if ode else [f'input = "{plant.input}"', f"outputs = {json.dumps(list(plant.outputs))}"]
    lines += [plant.table, "[plant.parameters]"]
    for name, true in plant.parameters.items():
        held = name in plant.held
        value = float(true * (1.0 if held else rng.uniform(0.9, 1.1)))
        lines.append(f"{name} = {{ value = {value!r}, free = {str(not held).lower()} }}")
    return "\n".join(lines) + "\n"

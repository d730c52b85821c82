"""Simulated recordings with one fault each, and sound ones: what `identify` should and should not say.

The simulator is scipy's and shares nothing with firmloop's. Each Scene names the checks of which one has to speak.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy

Array = np.ndarray


@dataclass(frozen=True)
class Scene:
    """`table` is a project's [plant]; `expected` the checks of which one has to speak, none for a sound recording."""

    name: str
    table: Mapping[str, object]
    time: Array
    columns: Mapping[str, Array]
    expected: tuple[str, ...]


MOTOR = {"R_ohm": 2.5, "L_H": 1e-3, "ke_V_s_rad": 0.037, "kt_N_m_A": 0.037, "J_kg_m2": 1.2e-5, "b_N_m_s_rad": 4e-6}


def held(a, b, c, drive: Array, step: float, start=None) -> Array:
    """Outputs (n, r) of a linear plant whose input is held from row to row; row k is read before input k acts."""
    a, b, c = np.atleast_2d(a), np.asarray(b, dtype=float).reshape(-1, 1), np.atleast_2d(c)
    n = len(a)
    whole = scipy.linalg.expm(step * np.block([[a, b], [np.zeros((1, n + 1))]]))
    x = np.zeros(n) if start is None else np.asarray(start, dtype=float)
    seen = []
    for u in drive:
        seen.append(c @ x)
        x = whole[:n, :n] @ x + whole[:n, n] * u
    return np.array(seen)


def delayed(drive: Array, rows: int) -> Array:
    return np.concatenate([np.zeros(rows), drive])[: len(drive)]


def steps(random, rows: int, levels: Sequence[float], longest: int) -> Array:
    """Random levels, each held for a while, after a rest at zero."""
    drive: list[float] = [0.0] * (longest // 3)
    while len(drive) < rows:
        drive += [float(random.choice([level for level in levels if level != drive[-1]]))] * int(
            random.integers(longest // 4, longest)
        )
    return np.array(drive[:rows])


def noise(random, rows: int, size: float, memory: float = 0.0) -> Array:
    drawn = random.normal(0.0, size * np.sqrt(1.0 - memory**2), rows + 500)
    return scipy.signal.lfilter([1.0], [1.0, -memory], drawn)[500:]


def off(random, values: Mapping[str, float], fixed: Sequence[str] = (), most: float = 1.6) -> dict[str, object]:
    """Nominal values that are off by up to `most`, as a data sheet's or a first guess are."""
    return {
        name: {
            "value": value if name in fixed else value * float(most ** random.uniform(-1.0, 1.0)),
            "free": name not in fixed,
        }
        for name, value in values.items()
    }


def motor(random, rows=2000, step=1e-3, memory=0.0, gear=1.0, levels=(-10.0, -5.0, 4.0, 8.0, 12.0), friction=0.0):
    """Speed and current of a brushed motor; `friction` is dry."""
    r, inductance, ke, kt, inertia, b = MOTOR.values()
    drive = steps(random, rows, levels, 250)
    if friction == 0.0:
        a = [[-r / inductance, -ke / inductance], [kt / inertia, -b / inertia]]
        run = held(a, [1 / inductance, 0.0], np.eye(2), drive, step)
    else:
        run, x, fine = [], np.zeros(2), 50
        for u in drive:
            run.append(x.copy())
            for _ in range(fine):
                h = step / fine
                x[0] += h * (u - r * x[0] - ke * x[1]) / inductance
                push = kt * x[0] - b * x[1]
                if x[1] == 0.0 and abs(push) < friction:
                    continue
                w = x[1] + h * (push - friction * np.sign(x[1] or push)) / inertia
                x[1] = 0.0 if w * x[1] < 0.0 else w
        run = np.array(run)
    speed = run[:, 1] / gear + noise(random, rows, 0.5 / gear, memory)
    current = run[:, 0] + noise(random, rows, 0.02, memory)
    table = {
        "kind": "dc_motor", "input": "voltage_V", "outputs": ["speed_rad_s", "current_A"],
        "parameters": off(random, MOTOR, ("kt_N_m_A",)),
    }  # fmt: skip
    return table, np.arange(rows) * step, {"voltage_V": drive, "speed_rad_s": speed, "current_A": current}


def heater(random, rows=900, step=2.0, memory=0.0, lag=140.0, gain=0.62, start=0.0, size=0.08, drive=None):
    """A lag with a delay."""
    if drive is None:
        drive = steps(random, rows, (0.0, 20.0, 45.0, 80.0), int(3 * lag / step))
    level = held([[-1 / lag]], [gain / lag], [[1.0]], delayed(drive, 7), step, [start])[:, 0]
    table = {
        "kind": "first_order", "input": "heater_percent", "outputs": ["temperature_C"],
        "parameters": off(random, {"gain": gain, "time_constant_s": lag, "delay_s": 7 * step}),
    }  # fmt: skip
    return (
        table,
        np.arange(rows) * step,
        {"heater_percent": drive, "temperature_C": level + noise(random, rows, size, memory)},
    )


def swing(random, rows=1200, step=0.01, memory=0.0, frequency=6.0, damping=0.3, gain=2.0, drive=None):
    """A second-order lag."""
    if drive is None:
        drive = steps(random, rows, (-3.0, -1.0, 1.0, 2.0), 150)
    a = [[0.0, 1.0], [-(frequency**2), -2 * damping * frequency]]
    level = held(a, [0.0, gain * frequency**2], [[1.0, 0.0]], drive, step)[:, 0]
    values = {"gain": gain, "natural_frequency_rad_s": frequency, "damping_ratio": damping}
    table = {
        "kind": "second_order", "input": "valve_V", "outputs": ["level"],
        "parameters": {**off(random, values), "delay_s": {"value": 0.0, "free": False}},
    }  # fmt: skip
    return table, np.arange(rows) * step, {"valve_V": drive, "level": level + noise(random, rows, 0.03, memory)}


def kiln(random, rows=1200, step=0.5, lag=20.0, second=5.0, gain=2.5):
    """Two lags, with the heater on or off."""
    drive = steps(random, rows, (0.0, 40.0), 100)
    level = held([[-1 / lag, 0.0], [1 / second, -1 / second]], [gain / lag, 0.0], [[0.0, 1.0]], drive, step)[:, 0]
    values = {"gain": gain, "time_constant_s": lag, "second_time_constant_s": second}
    fixed = {name: {"value": 0.0, "free": False} for name in ("zero_time_constant_s", "delay_s")}
    table = {
        "kind": "process", "input": "heater_W", "outputs": ["temperature_C"],
        "parameters": {**off(random, values, most=2.5), **fixed},
    }  # fmt: skip
    return table, np.arange(rows) * step, {"heater_W": drive, "temperature_C": level + noise(random, rows, 0.05, 0.0)}


def stage(random, rows=1500, step=0.002, memory=0.0, levels=(-6.0, -2.0, 3.0, 6.0)):
    """A mass on a guide, seen by its position and its speed."""
    mass, damping = 1.5, 4.0
    drive = steps(random, rows, levels, 200)
    run = held([[-damping / mass, 0.0], [1.0, 0.0]], [1 / mass, 0.0], np.eye(2), drive, step)
    table = {
        "kind": "linear_stage", "input": "force_N", "outputs": ["position_m", "speed_m_s"],
        "parameters": off(random, {"mass_kg": mass, "b_N_s_m": damping}),
    }  # fmt: skip
    place, speed = run[:, 1] + noise(random, rows, 1e-3, memory), run[:, 0] + noise(random, rows, 5e-3, memory)
    return table, np.arange(rows) * step, {"force_N": drive, "position_m": place, "speed_m_s": speed}


def closed_loop(random, rows=1200, step=2.0, memory=0.0, lag=140.0, gain=0.62):
    """A heater under a PI controller that reads it with noise."""
    goal = steps(random, rows, (0.0, 15.0, 30.0), 250)
    drive, seen, x, total = np.zeros(rows), np.zeros(rows), 0.0, 0.0
    sensor = noise(random, rows, 0.08, memory)
    for k in range(rows):
        seen[k] = x + sensor[k]
        total += step * 0.02 * (goal[k] - seen[k])
        drive[k] = 3.0 * (goal[k] - seen[k]) + total
        late = drive[k - 7] if k >= 7 else 0.0
        x += (1 - np.exp(-step / lag)) * (gain * late - x)
    table = heater(random, rows=10)[0]
    return table, np.arange(rows) * step, {"heater_percent": drive, "temperature_C": seen}


def changed(made, **columns: Callable[[Array], Array]):
    table, time, held_columns = made
    return table, time, {name: columns.get(name, lambda v: v)(v) for name, v in held_columns.items()}


def exchanged(made, one: str, other: str):
    """Give two columns each other's name, the time among them."""
    table, time, columns = made
    held = {"time_s": time, **columns}
    held[one], held[other] = held[other], held[one]
    return table, held.pop("time_s"), held


def retimed(made, factor: float):
    table, time, columns = made
    return table, factor * time, columns


def bent(made):
    """Record a drive that is not what the plant gets: a valve that does little near its middle."""
    table, time, columns = made
    drive = columns["valve_V"]
    return table, time, {**columns, "valve_V": drive + 1.8 * np.sign(drive) * (np.abs(drive) > 1.5)}


def too_simple(made):
    """Ask for a first-order lag."""
    _, time, columns = made
    values = {"gain": 2.0, "time_constant_s": 0.2, "delay_s": 0.01}
    return {"kind": "first_order", "input": "valve_V", "outputs": ["level"], "parameters": values}, time, columns


SOUND: dict[str, Callable] = {
    "motor": motor,
    "motor, coloured noise": lambda r: motor(r, memory=0.9),
    "motor, few rows": lambda r: motor(r, rows=300),
    "heater": heater,
    "heater, slow noise": lambda r: heater(r, memory=0.95),
    "heater, few rows": lambda r: heater(r, rows=150, step=8.0),
    "heater, not at rest": lambda r: heater(r, start=25.0),
    "closed loop": closed_loop,
    "closed loop, coloured noise": lambda r: closed_loop(r, memory=0.8),
    "swing": swing,
    "swing, coloured noise": lambda r: swing(r, memory=0.9),
    "slow plant": lambda r: heater(r, rows=600, step=2.0, lag=400.0),
    "stage": stage,
    "stage, coloured noise": lambda r: stage(r, memory=0.8),
    "coarse sensor": lambda r: changed(heater(r), temperature_C=lambda v: np.round(v * 4.0) / 4.0),
}
RPM = 60.0 / (2.0 * np.pi)
UNITS = ("scale", "motor_constants", "clock_unit")
FAULTS: dict[str, tuple[Callable, tuple[str, ...]]] = {
    "encoder reversed": (lambda r: changed(motor(r), speed_rad_s=np.negative), ("sign",)),
    "shunt reversed": (lambda r: changed(motor(r), current_A=np.negative), ("sign",)),
    "heater reversed": (lambda r: changed(heater(r), temperature_C=np.negative), ("sign",)),
    "sensor reversed": (lambda r: changed(swing(r), level=np.negative), ("sign",)),
    "scale reversed": (lambda r: changed(stage(r), position_m=lambda v: -v), ("sign",)),
    "speed in rpm": (lambda r: changed(motor(r), speed_rad_s=lambda v: v * RPM), UNITS),
    "speed in degrees": (lambda r: changed(motor(r), speed_rad_s=np.degrees), UNITS),
    "speed in turns": (lambda r: changed(motor(r), speed_rad_s=lambda v: v / (2 * np.pi)), UNITS),
    "current in mA": (lambda r: changed(motor(r), current_A=lambda v: 1e3 * v), UNITS),
    "position in mm": (lambda r: changed(stage(r), position_m=lambda v: 1e3 * v), UNITS),
    "level in thousandths": (lambda r: changed(swing(r), level=lambda v: 1e3 * v), UNITS),
    "time in ms": (lambda r: retimed(motor(r), 1e3), UNITS),
    "time in minutes": (lambda r: retimed(heater(r, lag=60.0), 1.0 / 60.0), UNITS),
    "ambient": (lambda r: changed(heater(r), temperature_C=lambda v: v + 21.0), ("rest",)),
    "cold room": (lambda r: changed(heater(r, lag=60.0), temperature_C=lambda v: v - 6.0), ("rest",)),
    "level has a zero": (lambda r: changed(swing(r), level=lambda v: v + 1.5), ("rest",)),
    "current has a zero": (lambda r: changed(motor(r), current_A=lambda v: v + 0.4), ("rest",)),
    "gear": (lambda r: motor(r, gear=float(r.choice([4.0, 20.0, 51.0]))), ("motor_constants",)),
    "input never moves": (lambda r: heater(r, drive=np.full(900, 40.0)), ("excitation",)),
    "one sine": (lambda r: swing(r, drive=np.sin(4.0 * np.arange(1200) * 0.01)), ("excitation",)),
    "too little": (lambda r: heater(r, drive=np.where(np.arange(900) < 300, 0.0, 0.1)), ("excitation", "refused")),
    "drifts": (lambda r: changed(swing(r), level=lambda v: v + np.linspace(-0.8, 0.8, len(v))), ("drift", "rest")),
    "warms up": (lambda r: changed(motor(r), current_A=lambda v: v + np.linspace(-0.3, 0.3, len(v))), ("drift",)),
    "dry friction": (lambda r: motor(r, friction=8e-3), ("structure", "rest")),
    "valve bends": (lambda r: bent(swing(r)), ("structure", "rest")),
    "an order is missing": (lambda r: too_simple(swing(r)), ("structure",)),
    "speed and current exchanged": (lambda r: exchanged(motor(r), "speed_rad_s", "current_A"), ("swapped",)),
    "input and output exchanged": (lambda r: exchanged(heater(r), "heater_percent", "temperature_C"), ("swapped",)),
}  # fmt: skip


def scene(name: str) -> Scene:
    """Return the recording of one name that `sound` or `faulty` gives: a kind, and the seed it is drawn with."""
    kind, _, seed = name.rpartition(" ")
    if kind in SOUND:
        return Scene(name, *SOUND[kind](np.random.default_rng([int(seed), list(SOUND).index(kind)])), ())
    make, expected = FAULTS[kind]
    return Scene(name, *make(np.random.default_rng([int(seed), 100 + list(FAULTS).index(kind)])), expected)


def sound(first: int = 0) -> list[Scene]:
    """Sixty recordings with nothing wrong, of seeds from `first` on."""
    return [scene(f"{kind} {seed}") for kind in SOUND for seed in range(first, first + 4)]


def faulty(first: int = 0) -> list[Scene]:
    """Sixty recordings with one fault each, of seeds from `first` on."""
    names = [f"{kind} {seed}" for seed in range(first, first + 3) for kind in FAULTS]
    return [scene(name) for name in names[:60]]

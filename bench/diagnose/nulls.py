"""Write a null case: a linear plant moved exactly, nothing hidden, under noise of many colors."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from bench.diagnose.hidden import Truth, write_truth
from bench.diagnose.linear_plants import Linear, drawn_motor, drawn_stage, moved, project_text
from firmloop.identify.recordings.recording import make_recording, write_recording

Array = NDArray[np.float64]
COLORS = ("white", "first_order", "one_over_f", "hum", "disturbance")


def _first_order(rng: np.random.Generator) -> Linear:
    gain, lag = 10.0 ** rng.uniform(-1.0, 2.0), 10.0 ** rng.uniform(-1.0, 0.5)
    output = ("speed_rad_s", "temperature_K", "tacho_V")[int(rng.integers(3))]
    matrices = (np.array([[-1.0 / lag]]), np.array([gain / lag]), np.eye(1), np.zeros(1))
    values = {"gain": gain, "time_constant_s": lag, "delay_s": 0.0}
    return Linear('kind = "first_order"', values, ("delay_s",), matrices, "voltage_V", (output,), 10.0, 0.05 * lag)


def _second_order(rng: np.random.Generator) -> Linear:
    gain, wn, zeta = 10.0 ** rng.uniform(-1.0, 1.0), 10.0 ** rng.uniform(0.5, 2.0), rng.uniform(0.1, 1.2)
    a = np.array([[0.0, 1.0], [-(wn**2), -2.0 * zeta * wn]])
    output = ("position_rad", "output_V")[int(rng.integers(2))]
    matrices = (a, np.array([0.0, gain * wn**2]), np.array([[1.0, 0.0]]), np.zeros(1))
    values = {"gain": gain, "natural_frequency_rad_s": wn, "damping_ratio": zeta, "delay_s": 0.0}
    return Linear('kind = "second_order"', values, ("delay_s",), matrices, "voltage_V", (output,), 5.0, 0.1 / wn)


def _two_bodies(rng: np.random.Generator) -> Linear:
    first, second = 10.0 ** rng.uniform(-3.5, -2.5), 10.0 ** rng.uniform(-3.5, -2.5)
    reduced = first * second / (first + second)
    spring = reduced * (2.0 * np.pi * rng.uniform(3.0, 15.0)) ** 2
    link, bearing = 0.1 * np.sqrt(spring * reduced), (first + second) / rng.uniform(0.2, 1.0)
    a = np.array([
        [-(bearing + link) / first, link / first, -spring / first],
        [link / second, -link / second, spring / second],
        [1.0, -1.0, 0.0],
    ])  # fmt: skip
    matrices = (a, np.array([1.0 / first, 0.0, 0.0]), np.eye(3)[:2], np.zeros(2))
    values = {"J1": first, "J2": second, "k": spring, "c": link, "b": bearing}
    return Linear(_TWO_BODIES, values, (), matrices, "torque_N_m", ("w1_rad_s", "w2_rad_s"), 50.0 * bearing, 4e-3)


def _two_lumps(rng: np.random.Generator) -> Linear:
    core, shell = rng.uniform(2.0, 20.0), rng.uniform(2.0, 20.0)
    across, away = rng.uniform(0.05, 0.5), rng.uniform(0.02, 0.2)
    a = np.array([[-across / core, across / core], [across / shell, -(across + away) / shell]])
    matrices = (a, np.array([1.0 / core, 0.0]), np.eye(2), np.zeros(2))
    values = {"C1": core, "C2": shell, "h": across, "g": away}
    outputs = ("core_K", "shell_K")
    return Linear(_TWO_LUMPS, values, (), matrices, "heater_W", outputs, 20.0 * away, 0.1 * shell / (across + away))


_TWO_BODIES = """kind = "ode"
states = ["w1_rad_s", "w2_rad_s", "twist_rad"]
inputs = ["torque_N_m"]
[plant.outputs]
w1_rad_s = "w1_rad_s"
w2_rad_s = "w2_rad_s"
[plant.derivatives]
w1_rad_s = "(torque_N_m - b*w1_rad_s - k*twist_rad - c*(w1_rad_s - w2_rad_s))/J1"
w2_rad_s = "(k*twist_rad + c*(w1_rad_s - w2_rad_s))/J2"
twist_rad = "w1_rad_s - w2_rad_s"
[plant.balances]
w1_rad_s = { kind = "torque", per = "1/J1", effort = "torque_N_m" }
w2_rad_s = { kind = "torque", per = "1/J2" }"""
_TWO_LUMPS = """kind = "ode"
states = ["core_K", "shell_K"]
inputs = ["heater_W"]
[plant.outputs]
core_K = "core_K"
shell_K = "shell_K"
[plant.derivatives]
core_K = "(heater_W - h*(core_K - shell_K))/C1"
shell_K = "(h*(core_K - shell_K) - g*shell_K)/C2"
[plant.balances]
core_K = { kind = "flow", per = "1/C1" }
shell_K = { kind = "flow", per = "1/C2" }"""
PLANTS: Mapping[str, Callable[[np.random.Generator], Linear]] = {
    "motor": drawn_motor, "stage": drawn_stage, "first_order": _first_order, "second_order": _second_order,
    "two_bodies": _two_bodies, "two_lumps": _two_lumps,
}  # fmt: skip


def drawn_memory(rng: np.random.Generator) -> float:
    """Draw over how many rows noise of first order is forgotten, between one and fifty."""
    return float(50.0 ** rng.uniform(0.0, 1.0))


def colored(color: str, rows: int, rng: np.random.Generator, step: float, memory: float) -> Array:
    """Return noise (n,) of rms 1: white, of a lag of `memory` rows, 1/f, or white and the mains beside it."""
    white = rng.normal(size=rows)
    if color == "first_order":
        keep = float(np.exp(-1.0 / memory))
        settled = lfilter([1.0], [1.0, -keep], rng.normal(size=rows + 500))[500:]
        return np.asarray(settled * np.sqrt(1.0 - keep**2))
    if color == "one_over_f":
        spectrum = np.fft.rfft(white)
        spectrum[1:] /= np.sqrt(np.arange(1, len(spectrum)))
        spectrum[0] = 0.0
        shaped = np.fft.irfft(spectrum, rows)
        return np.asarray(shaped / np.std(shaped))
    if color == "hum":
        mains = np.sin(2.0 * np.pi * (50.0 * step * np.arange(rows) + rng.random()))
        ratio = rng.uniform(0.5, 2.0)
        return np.asarray((white + ratio * np.sqrt(2.0) * mains) / np.sqrt(1.0 + ratio**2))
    return np.asarray(white)


def of_sensors(
    color: str, rows: int, rng: np.random.Generator, step: float, sizes: Array, memories: Sequence[float]
) -> Array:
    """Return the noise (n, r) of sensors, each of its own rms and memory."""
    noise = [size * colored(color, rows, rng, step, own) for size, own in zip(sizes, memories, strict=True)]
    return np.stack(noise, axis=1)


def drawn_drive(rows: int, rng: np.random.Generator) -> Array:
    """Return an input (n,) between -1 and 1 that begins with zeros: steps, a binary sequence, a chirp, a staircase."""
    form = int(rng.integers(4))
    if form == 0:
        lengths = rng.integers(rows // 25, rows // 10, 60)
        drive = np.repeat(rng.uniform(-1.0, 1.0, 60), lengths)[:rows]
    elif form == 1:
        drive = np.repeat(rng.choice([-0.8, 0.8], rows), rng.integers(4, 30, rows))[:rows]
    elif form == 2:
        share = np.arange(rows) / rows
        drive = 0.9 * np.sin(2.0 * np.pi * (2.0 * share + rng.uniform(5.0, 20.0) * share**2))
    else:
        drive = np.repeat(np.sin(2.4 * np.arange(14) + rng.uniform(0.0, 6.0)), rows // 13)[:rows]
    drive[:10] = 0.0
    return np.asarray(drive)


def write(seed: int, folder: Path) -> None:
    """Write one case: 400 to 1500 rows, one to three train recordings."""
    folder.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng([seed, 81])
    form = sorted(PLANTS)[int(rng.integers(len(PLANTS)))]
    color = COLORS[int(rng.integers(len(COLORS)))]
    plant = PLANTS[form](rng)
    rows, count = int(rng.integers(400, 1501)), int(rng.integers(1, 4))
    level, fineness = 10.0 ** rng.uniform(-2.7, -1.3), rng.uniform(0.05, 0.5)
    added: list[Array] = []
    memory = drawn_memory(rng)  # of a disturbance
    memories = [drawn_memory(rng) for _ in plant.outputs]  # a sensor's is the same in every recording
    for k in range(count):
        drive = plant.top * drawn_drive(rows, rng)
        push = np.zeros(rows)
        if color == "disturbance":
            push = rng.uniform(0.005, 0.02) * plant.top * colored("first_order", rows, rng, plant.step, memory)
        clean = moved(plant.matrices, plant.step, drive)
        shown = moved(plant.matrices, plant.step, drive + push)
        sizes = level * np.maximum(np.std(clean, axis=0), 1e-12)
        shown = shown + of_sensors(color, rows, rng, plant.step, sizes, memories)
        grid = fineness * sizes
        shown = np.round(shown / grid) * grid
        added.append(shown - clean)
        columns = {plant.input: drive, **dict(zip(plant.outputs, shown.T, strict=True))}
        recording = make_recording(np.arange(rows) * plant.step, columns, "train", "")
        write_recording(recording, folder / f"train_{k + 1}.csv")
    (folder / "project.toml").write_text(project_text(plant, count, rng), encoding="utf-8")
    rms = np.sqrt(np.mean(np.concatenate(added) ** 2, axis=0))
    about = {"machine": form, "color": color, "colored": color != "white", "rows": rows, "train": count, "test": 0}
    named = dict(zip(plant.outputs, rms.tolist(), strict=True))
    write_truth(Truth("nulls", seed, (), "", 0.0, plant.parameters, named, about), folder)

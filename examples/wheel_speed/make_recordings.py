"""Make the recordings of this example with a simulator that is not the one firmloop fits with.

The motor is integrated by SciPy's Radau method between the instants at which the voltage changes; the bench around it
has a clock that jitters, a speed measured with the resolution of a counter, and a current read by a noisy 12-bit
converter. Run it in this folder to make the files again: same seed, same bytes.
"""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

SEED = 1
PERIOD = 0.001  # s, nominal row distance
JITTER = 20e-6  # s, half width of the clock's jitter
SPEED_RESOLUTION = 0.5  # rad/s, one count of the speed measurement
SPEED_NOISE = 0.4  # rad/s rms
CURRENT_RESOLUTION = 4.0 / 4096  # A, 12 bits over 4 A
CURRENT_NOISE = 8e-3  # A rms

# What the motor on this bench is; the project file starts from a data sheet that is up to 10 % off.
# kt equals ke, as it must in SI units.
R, L, KE, KT, J, B = 7.4, 1.1e-3, 0.0213, 0.0213, 3.3e-6, 3.6e-6


def motor(_: float, state: np.ndarray, voltage: float) -> tuple[float, float]:
    """Return the slopes of current and speed."""
    current, speed = state
    return (voltage - R * current - KE * speed) / L, (KT * current - B * speed) / J


def measure(time: np.ndarray, voltage: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return current and speed (n, 2) as the bench reads them, each row before that row's voltage acts."""
    truth = np.zeros((len(time), 2))
    edges = [0, *(np.flatnonzero(np.diff(voltage)) + 1), len(time) - 1]
    for first, last in pairwise(edges):
        if last == first:
            continue
        span = (time[first], time[last])
        answer = solve_ivp(
            motor, span, truth[first], "Radau", time[first : last + 1], args=(voltage[first],), rtol=1e-9, atol=1e-9
        )
        truth[first : last + 1] = answer.y.T
    noisy = truth + rng.normal(size=truth.shape) * (CURRENT_NOISE, SPEED_NOISE)
    steps = np.array([CURRENT_RESOLUTION, SPEED_RESOLUTION])
    return np.asarray(np.round(noisy / steps) * steps)


def staircase(levels: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    """Hold each level (V) for its number of rows."""
    return np.repeat(levels, lengths)


def write(name: str, voltage: np.ndarray, rng: np.random.Generator) -> None:
    """Run one experiment and write it beside this script."""
    rows = len(voltage)
    time = np.round(PERIOD * np.arange(rows) + rng.uniform(-JITTER, JITTER, rows), 6)
    time[0] = 0.0
    current, speed = measure(time, voltage, rng).T
    lines = ["time_s,voltage_V,speed_rad_s,current_A"]
    lines += [f"{t:.6f},{u:g},{w:g},{i:.5g}" for t, u, w, i in zip(time, voltage, speed, current, strict=True)]
    (Path(__file__).parent / name).write_text("\n".join([*lines, ""]), encoding="utf-8")


def main() -> None:
    """Make the two recordings to fit to and the one to judge by."""
    rng = np.random.default_rng(SEED)
    steps = staircase(np.array([0.0, 6.0, 0.0, -6.0, 10.0, -10.0, 3.0, 0.0]), np.array([100, *[450] * 6, 200]))
    write("steps.csv", steps, rng)
    lengths = rng.integers(8, 60, 90)
    prbs = staircase(np.where(rng.random(90) < 0.5, -1.0, 1.0) * 9.0, lengths)[:3000]
    write("prbs.csv", np.concatenate([np.zeros(50), prbs]), rng)
    ramp = np.concatenate([np.linspace(0.0, 11.0, 40), np.linspace(11.0, -11.0, 60), np.linspace(-11.0, 0.0, 30)])
    write("ramp.csv", staircase(np.round(ramp, 2), np.full(130, 20)), rng)


if __name__ == "__main__":
    main()

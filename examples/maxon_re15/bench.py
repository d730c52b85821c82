"""A bench with the assumed RE 15, simulated in numpy by equations of its own: recordings, and readings of the tests.

    python -m examples.maxon_re15.bench

Nothing of firmloop's engine is in it: between two instants of 10 us the motor's two states are moved on by the matrix
exponential of its equations, summed as a series. The bench around it reads at 10 kHz, as the study does: the speed with
the noise and the resolution of a tachometer, the current by a noisy 12-bit converter. Same seed, same bytes.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# What stands on this bench: within 8 % of the assumed data sheet of re15.toml, as one motor of a series is.
R, L, K, J, B = 3.12, 1.05e-4, 5.9e-3, 6.4e-8, 2.1e-8  # ohm, H, V s/rad and N m/A, kg m^2, N m s/rad
SEED = 15
PERIOD = 1e-4  # s, of the recordings
FINE = 1e-5  # s, between two of which voltage and load stand still
SPEED_NOISE, SPEED_RESOLUTION = 0.6, 0.25  # rad/s rms, rad/s
CURRENT_NOISE, CURRENT_RESOLUTION = 3e-3, 5.0 / 4096  # A rms, A
READING = 0.002  # relative deviation of one reading of a meter


def moved(span: float, resistance: float = R, inductance: float = L, inertia: float = J) -> tuple[Array, Array]:
    """Return Phi (2, 2) and Gamma (2, 2) of state (A, rad/s) and input (V, load in N m) held for `span`, s."""
    a = np.array([[-resistance / inductance, -K / inductance], [K / inertia, -B / inertia]])
    b = np.array([[1 / inductance, 0.0], [0.0, -1 / inertia]])
    whole, term, total = np.eye(2), np.eye(2) * span, np.eye(2) * span
    for power in range(1, 30):
        whole = whole + a @ term
        term = a @ term * span / (power + 1)
        total = total + term
    return whole, np.asarray(total @ b)


PHI, GAMMA = moved(FINE)


class Motor:
    """The motor in motion: current A and speed rad/s, moved on under a voltage and a load torque."""

    def __init__(self) -> None:
        self.state = np.zeros(2)

    def go(self, seconds: float, volts: float, load: float = 0.0) -> None:
        """Hold voltage (V) and load torque (N m) for so long."""
        pushed = GAMMA @ np.array([volts, load])
        for _ in range(round(seconds / FINE)):
            self.state = PHI @ self.state + pushed


def read(state: Array, random: np.random.Generator) -> Array:
    """Return current and speed (..., 2) as the bench reads them."""
    steps = np.array([CURRENT_RESOLUTION, SPEED_RESOLUTION])
    noisy = state + random.normal(size=state.shape) * (CURRENT_NOISE, SPEED_NOISE)
    return np.asarray(np.round(noisy / steps) * steps)


def recorded(volts: Array, random: np.random.Generator) -> str:
    """Run one experiment: each row is read before its voltage acts, which then holds until the next row."""
    motor, states = Motor(), []
    for held in volts:
        states.append(motor.state)
        motor.go(PERIOD, float(held))
    current, speed = read(np.array(states), random).T
    lines = ["time_s,voltage_V,speed_rad_s,current_A"]
    lines += [
        f"{PERIOD * k:.4f},{u:g},{w:g},{i:.5g}" for k, (u, w, i) in enumerate(zip(volts, speed, current, strict=True))
    ]
    return "\n".join([*lines, ""])


def readings(random: np.random.Generator) -> dict[str, dict[str, list[float]]]:
    """Read the meters of the tests in which everything has settled: as [standard_tests] takes them, each thrice."""

    def seen(values: Array) -> list[float]:
        return [float(f"{value:.4g}") for value in values * (1 + READING * random.normal(size=len(values)))]

    still = np.repeat([0.5, 1.0, 1.5], 3)  # V, rotor locked
    shaken, hertz = np.repeat(1.0, 3), np.array([2e3, 5e3, 1e4])  # V rms, rotor locked
    free = np.repeat([2.0, 4.0, 6.0], 3)  # V, without load
    speed = free / (K + R * B / K)
    return {
        "locked_rotor_dc": {"voltage_V": still.tolist(), "current_A": seen(still / R)},
        "locked_rotor_ac": {
            "voltage_V": shaken.tolist(),
            "current_A": seen(shaken / np.hypot(R, 2 * np.pi * hertz * L)),
            "frequency_Hz": hertz.tolist(),
        },
        "no_load": {"voltage_V": free.tolist(), "current_A": seen(B * speed / K), "speed_rad_s": seen(speed)},
    }


def tables(tests: dict[str, dict[str, list[float]]]) -> str:
    """Write the readings as the project file holds them."""
    lines = []
    for name, columns in tests.items():
        lines += [f"[standard_tests.{name}]", *(f"{key} = {values}" for key, values in columns.items()), ""]
    return "\n".join(lines)


def files() -> dict[str, str]:
    """Make every recording, by its name: three steps of the voltage to fit to, a switched voltage, one to judge by."""
    random = np.random.default_rng(SEED)
    step = np.concatenate([np.zeros(50), np.full(450, 6.0)])
    made = {f"step_{k}.csv": recorded(step, random) for k in (1, 2, 3)}
    switched = np.repeat(np.where(random.random(40) < 0.5, -5.0, 5.0), random.integers(10, 60, 40))
    made["switched.csv"] = recorded(switched, random)
    ramp = np.concatenate([np.linspace(0, 6, 20), np.linspace(6, -6, 40), np.linspace(-6, 0, 20)])
    made["ramp.csv"] = recorded(np.repeat(np.round(ramp, 2), 15), random)
    return made


def main() -> None:
    """Write the recordings beside this file, and print the readings of the tests."""
    for name, text in files().items():
        (Path(__file__).parent / name).write_text(text, encoding="utf-8")
    print(tables(readings(np.random.default_rng(SEED + 1))))


if __name__ == "__main__":
    main()

"""A bench with a motor of the L3510's datasheet, simulated in numpy by equations of its own: starts from rest.

    python -m examples.baldor_l3510.bench

Nothing of firmloop's engine is in it: the flux linkages of both stator windings and of the rotor in stator coordinates,
the start capacitor and the speed are moved on by the classical Runge-Kutta method (P. C. Krause and others, Analysis of
Electric Machinery, chapter on two-phase machines: unsymmetrical windings, aux in series with a capacitor until the
centrifugal switch opens). Circuit and inertia are those that the audit finds; speed is read at 1 kHz with noise.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

R_MAIN, R_AUX, R_ROTOR = 0.525, 1.17, 0.6836  # ohm
LEAK_MAIN, LEAK_AUX, LEAK_ROTOR = 1.394e-3, 4.962e-3, 1.394e-3  # H
MUTUAL, TURNS = 62.09e-3, 1.7956  # H, turns of aux per turn of main
PAIRS, CAPACITANCE, HERTZ, VOLTS = 2, 340e-6, 60.0, 115.0
INERTIA, DRAG = 0.0824, 85.4 / 188.5**2  # kg m^2 so that a start takes the study's 0.85 s, N m s/rad
OPENS = 0.75 * 188.5  # rad/s, the centrifugal switch
FINE, PERIOD, SECONDS, REST = 1e-4, 1e-3, 1.5, 0.05  # s; of voltage 0 first
NOISE = {"speed_rad_s": 0.5, "aux_current_A": 0.3, "voltage_V": 2.0}  # rms
SEED = 35
CLOSED = np.linalg.inv(
    np.array(
        [
            [LEAK_MAIN + MUTUAL, 0, MUTUAL, 0],
            [0, LEAK_AUX + TURNS**2 * MUTUAL, 0, TURNS * MUTUAL],
            [MUTUAL, 0, LEAK_ROTOR + MUTUAL, 0],
            [0, TURNS * MUTUAL, 0, LEAK_ROTOR + MUTUAL],
        ]
    )
)
OPEN = np.zeros((4, 4))
OPEN[np.ix_([0, 2], [0, 2])] = CLOSED[np.ix_([0, 2], [0, 2])]
OPEN[3, 3] = 1 / (LEAK_ROTOR + MUTUAL)


@dataclass(frozen=True, slots=True)
class Start:
    """One start as the bench reads it, (n,) each at 1 kHz; `opened` is when the switch truly opened, s."""

    rms: Array  # V, as a power analyzer shows it: 0 or 115
    voltage: Array  # V
    aux_current: Array  # A
    speed: Array  # rad/s
    opened: float


def slope(state: Array, volts: float, inverse: Array, capacitance: float) -> Array:
    """Return d/dt of flux linkages main, aux, rotor d, rotor q (V s), capacitor voltage (V) and speed (rad/s)."""
    main, aux, direct, across = inverse @ state[:4]
    turning = PAIRS * state[5]
    torque = PAIRS * (state[2] * across - state[3] * direct)
    return np.array(
        [
            volts - R_MAIN * main,
            volts - state[4] - R_AUX * aux,
            -R_ROTOR * direct + turning * state[3],
            -R_ROTOR * across - turning * state[2],
            aux / capacitance,
            (torque - DRAG * state[5]) / INERTIA,
        ]
    )


def start(random: np.random.Generator, capacitance: float = CAPACITANCE) -> Start:
    """Switch the motor on at a random phase of the mains and read the start."""
    phase, state, inverse = random.uniform(0, 2 * np.pi), np.zeros(6), CLOSED
    seen, opened = [], np.inf
    for k in range(round((SECONDS + REST) / FINE)):
        time = k * FINE
        on = float(time >= REST - FINE / 2)
        volts = on * 2**0.5 * VOLTS * np.sin(2 * np.pi * HERTZ * (time + np.array([0, FINE / 2, FINE])) + phase)
        if k % round(PERIOD / FINE) == 0:
            seen.append((on * VOLTS, volts[0], float((inverse @ state[:4])[1]), state[5]))
        one = slope(state, volts[0], inverse, capacitance)
        two = slope(state + FINE / 2 * one, volts[1], inverse, capacitance)
        three = slope(state + FINE / 2 * two, volts[1], inverse, capacitance)
        four = slope(state + FINE * three, volts[2], inverse, capacitance)
        state = state + FINE / 6 * (one + 2 * two + 2 * three + four)
        if state[5] > OPENS and inverse is CLOSED:
            inverse, opened = OPEN, time
    rms, voltage, current, speed = np.array(seen).T
    return Start(
        rms,
        voltage + NOISE["voltage_V"] * random.normal(size=len(rms)),
        current + NOISE["aux_current_A"] * random.normal(size=len(rms)),
        speed + NOISE["speed_rad_s"] * random.normal(size=len(rms)),
        opened,
    )


def text(one: Start) -> str:
    """Write the voltage (rms) and the speed of a start as a recording."""
    rows = enumerate(zip(one.rms, one.speed, strict=True))
    return "\n".join(["time_s,voltage_V,speed_rad_s", *(f"{PERIOD * k:.3f},{u:g},{w:.2f}" for k, (u, w) in rows), ""])


def files() -> dict[str, str]:
    """Make the recordings by name: three starts, each switched on at another phase."""
    random = np.random.default_rng(SEED)
    return {f"start_{k}.csv": text(start(random)) for k in (1, 2, 3)}


if __name__ == "__main__":
    for name, content in files().items():
        (Path(__file__).parent / name).write_text(content, encoding="utf-8")

"""Make the recordings of the spindle: a permanent-magnet machine whose drive logs voltages, currents and speed.

They stand for a log of your own drive at 20 kHz, in the frame of the rotor. The machine is simulated in the frame of
its stator, phase by phase, which firmloop does nowhere. Run it in the folder where the files shall be: same seed, same
bytes.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

SEED = 1
PERIOD, SUBSTEPS = 50e-6, 20  # s, and steps of the integration within it
CURRENT_NOISE, SPEED_NOISE = 0.02, 0.5  # A, rad/s rms
R, LD, LQ, FLUX, PAIRS, J, B = 0.36, 0.2e-3, 0.33e-3, 6.4e-3, 4, 4.8e-6, 1.0e-5  # SI units


def rate(x: np.ndarray, voltage: complex) -> np.ndarray:
    """Return the rates of flux (two axes of the stator), speed and angle under a voltage of the stator."""
    flux, speed, angle = x[0] + 1j * x[1], x[2], x[3]
    turn = np.exp(1j * PAIRS * angle)
    own = flux / turn
    current = ((own.real - FLUX) / LD + 1j * own.imag / LQ) * turn
    torque = 1.5 * PAIRS * (flux.conjugate() * current).imag
    moved = voltage - R * current
    return np.array([moved.real, moved.imag, (torque - B * speed) / J, speed])


def machine(voltages: np.ndarray) -> np.ndarray:
    """Return i_d, i_q and speed (n, 3) at the beginning of each row, from rest, for v_d and v_q (n, 2)."""
    h, x, rows = PERIOD / SUBSTEPS, np.array([FLUX, 0.0, 0.0, 0.0]), []
    for v_d, v_q in voltages:
        own = (x[0] + 1j * x[1]) * np.exp(-1j * PAIRS * x[3])
        rows.append(((own.real - FLUX) / LD, own.imag / LQ, x[2]))
        for _ in range(SUBSTEPS):  # the drive turns its voltage with the rotor
            k1 = rate(x, (v_d + 1j * v_q) * np.exp(1j * PAIRS * x[3]))
            middle = x + h / 2 * k1
            x = x + h * rate(middle, (v_d + 1j * v_q) * np.exp(1j * PAIRS * middle[3]))
    return np.array(rows)


def write(name: str, voltages: np.ndarray, rng: np.random.Generator) -> None:
    """Run one experiment and write it to the folder that this is run in."""
    answers = machine(voltages)
    answers = answers + rng.normal(size=answers.shape) * (CURRENT_NOISE, CURRENT_NOISE, SPEED_NOISE)
    table = np.column_stack([PERIOD * np.arange(len(voltages)), voltages, answers])
    lines = ["time_s,voltage_d_V,voltage_q_V,current_d_A,current_q_A,speed_rad_s"]
    lines += [f"{t:.5f},{vd:g},{vq:g},{d:.4g},{q:.4g},{w:.5g}" for t, vd, vq, d, q, w in table]
    Path(name).write_text("\n".join([*lines, ""]), encoding="utf-8")


def held(levels: list[float], rows: int) -> np.ndarray:
    """Return each level for as many rows."""
    return np.repeat(levels, rows)


def main() -> None:
    """Make steps and random switching to fit, and a slow triangle to score."""
    rng = np.random.default_rng(SEED)
    steps = np.column_stack(
        [held([0, 1, -1, 0, 0, 1, -1, 0, 1, 0, -1, 0], 160), held([0, 0, 0, 4, 7, 7, 2, -5, -5, -8, 3, 0], 160)]
    )
    along, across = (held(list(rng.choice(levels, 40)), 40) for levels in ([-1.0, 1.0], [-5.0, 7.0]))
    switched = np.column_stack([along, across])
    wave = np.concatenate([np.linspace(0, 8, 30), np.linspace(8, -8, 60)])
    triangle = np.column_stack([held(list(np.round(0.5 * np.cos(wave), 2)), 20), held(list(np.round(wave, 2)), 20)])
    for name, voltages in (("steps", steps), ("switched", switched), ("triangle", triangle)):
        write(f"{name}.csv", voltages, rng)


if __name__ == "__main__":
    main()

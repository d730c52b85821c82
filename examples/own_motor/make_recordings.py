"""Make the recordings of the tutorial: a small motor when it was new, and later with dry friction in its bearing.

They stand for files of your own bench: the columns are called `t`, `u`, `omega` and `i`, in s, V, rad/s and A. Run it
in the folder where the files shall be: same seed, same bytes.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

SEED = 1
PERIOD, SUBSTEPS = 0.001, 40  # s, and steps of the integration within it
SPEED_NOISE, CURRENT_NOISE = 0.4, 8e-3  # rad/s, A rms
R, L, KE, KT, J, B = 7.4, 1.1e-3, 0.0213, 0.0213, 3.3e-6, 3.6e-6  # SI units
FRICTION = 5e-4  # N m, of the worn bearing


def motor(voltage: np.ndarray, friction: float) -> np.ndarray:
    """Return current and speed (n, 2) at the beginning of each row, from rest; `friction` in N m opposes the motion."""
    step, current, speed = PERIOD / SUBSTEPS, 0.0, 0.0
    decay = float(np.exp(-R * step / L))  # the current is much quicker than the speed: exact for a speed that is held
    rows = []
    for drive in voltage.tolist():
        rows.append((current, speed))
        for _ in range(SUBSTEPS):
            settled = (drive - KE * speed) / R
            before, current = current, settled + (current - settled) * decay
            free = speed + step * (KT * (before + current) / 2 - B * speed) / J
            speed = float(np.sign(free)) * max(abs(free) - step * friction / J, 0.0)
    return np.array(rows)


def write(name: str, voltage: np.ndarray, friction: float, rng: np.random.Generator) -> None:
    """Run one experiment and write it to the folder that this is run in."""
    current, speed = (motor(voltage, friction) + rng.normal(size=(len(voltage), 2)) * (CURRENT_NOISE, SPEED_NOISE)).T
    time = PERIOD * np.arange(len(voltage))
    lines = ["t,u,omega,i"]
    lines += [f"{t:.3f},{u:g},{w:.4g},{i:.4g}" for t, u, w, i in zip(time, voltage, speed, current, strict=True)]
    Path(name).write_text("\n".join([*lines, ""]), encoding="utf-8")


def main() -> None:
    """Make the same three experiments with the new and with the worn motor."""
    rng = np.random.default_rng(SEED)
    steps = np.repeat([0.0, 6.0, 0.0, -6.0, 10.0, -10.0, 3.0, 0.0], [100, *[200] * 7])
    switched = np.repeat(np.where(rng.random(50) < 0.5, -8.0, 8.0), 30)
    ramp = np.repeat(np.round(np.concatenate([np.linspace(0, 9, 40), np.linspace(9, -9, 80)]), 2), 10)
    for state, friction in (("new", 0.0), ("worn", FRICTION)):
        write(f"{state}_steps.csv", steps, friction, rng)
        write(f"{state}_switched.csv", switched, friction, rng)
        write(f"{state}_ramp.csv", ramp, friction, rng)


if __name__ == "__main__":
    main()

"""How often is a true parameter inside its 95 % interval? Noisy repeats of steps with known truth.

    python -m bench.host.coverage [REPEATS]

Right is 93 to 97 % of 500. The last rows are a real motor's: its recorded input, the model that was fitted to it as the
truth, and noise whose innovations are those of what that left over, less their mean, drawn anew and sent through its
autoregression. That motor's delay is 0, its bound, where an interval misses on one side only: 97.5 % are right there.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable

import numpy as np

from bench.host.real_steps import FILE, OUTPUT, model, pieces
from firmloop.identify.fitting.fit import fit
from firmloop.identify.fitting.noise import fit_noise
from firmloop.identify.plants.kinds import make_plant
from firmloop.identify.plants.plant import Plant
from firmloop.identify.recordings.conditioning import NONE
from firmloop.identify.recordings.recording import Recording, make_recording, read_recording
from firmloop.identify.simulation.simulate import simulate

FIXED = {"value": 0.0, "free": False}
CASES = {  # kind, truth, step, noise, seconds, rows
    "L3510, first order": (
        "first_order",
        {"gain": 0.79, "time_constant_s": 0.2, "delay_s": FIXED},
        115.0,
        2.0,
        1.5,
        600,
    ),
    "L3510, second order": (
        "second_order",
        {"gain": 0.789, "natural_frequency_rad_s": 6.0, "damping_ratio": 0.8, "delay_s": FIXED},
        115.0,
        2.0,
        3.0,
        600,
    ),
    "delay and zero": (
        "process",
        {
            "gain": 2.0,
            "time_constant_s": 0.5,
            "second_time_constant_s": 0.1,
            "zero_time_constant_s": 0.25,
            "delay_s": 0.052,
        },
        5.0,
        0.1,
        4.0,
        600,
    ),
    "RE 15, second order": (
        "second_order",
        {"gain": 55.0, "natural_frequency_rad_s": 400.0, "damping_ratio": 1.6, "delay_s": FIXED},
        12.0,
        8.0,
        0.06,
        600,
    ),
}


def coverage(name: str, repeats: int) -> dict[str, float]:
    """Share of the repeats whose interval holds the truth, by free parameter."""
    kind, truth, level, noise, span, rows = CASES[name]
    plant = make_plant(kind, "voltage_V", ["speed_rad_s"], truth)
    moments = np.linspace(0.0, span, rows)
    drive = np.where(moments >= 0.05 * span, level, 0.0)
    clean = simulate(plant, make_recording(moments, {"voltage_V": drive}, "truth", ""), None)[:, 0]

    def draw(seed: int) -> Recording:
        noisy = clean + np.random.default_rng(seed).normal(0.0, noise, rows)
        return make_recording(moments, {"voltage_V": drive, "speed_rad_s": noisy}, "", "")

    return shares(plant, draw, plant, repeats)


def shares(truth: Plant, draw: Callable[[int], Recording], begin: Plant, repeats: int) -> dict[str, float]:
    """Share of the fits, from `begin`, to drawn recordings whose interval holds the truth, by free parameter."""
    hits = {p.name: 0 for p in truth.parameters if p.free}
    for seed in range(repeats):
        found = fit(begin, [draw(seed)], [], NONE)
        for parameter, true in zip(found.plant.parameters, truth.parameters, strict=True):
            if parameter.name in hits:
                ends = parameter.interval_95
                hits[parameter.name] += ends is not None and ends[0] <= true.value <= ends[1]
    return {key: count / repeats for key, count in hits.items()}


def recorded(name: str, repeats: int) -> dict[str, float]:
    """Share of the repeats whose interval holds what was fitted to a recording, by free parameter."""
    whole = pieces(read_recording(FILE, {}), 10)[0]
    truth = fit(model(name), [whole], [], NONE)
    clean = truth.train[0].simulated[:, 0]
    left = whole.columns[OUTPUT] - clean
    colour = fit_noise([left], 0.0)
    innovations = colour.whiten(left)[len(colour.coefficients) :] * colour.scale
    innovations -= np.mean(innovations)

    def draw(seed: int) -> Recording:
        drawn = np.random.default_rng(seed).choice(innovations, 2 * len(clean))
        noisy = clean + colour.color(drawn)[len(clean) :]
        return make_recording(whole.time, {**whole.columns, OUTPUT: noisy}, "", "")

    return shares(truth.plant, draw, model(name), repeats)


if __name__ == "__main__":
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 500
    rows = [(title, coverage, title) for title in CASES]
    if FILE.exists():
        rows += [(f"ball and hoop, {name}", recorded, name) for name in ("first order", "first order, delay")]
    for title, measure, name in rows:
        began = time.perf_counter()
        words = ", ".join(f"{key} {share:.1%}" for key, share in measure(name, count).items())
        print(f"{title}: {words} ({count} repeats, {time.perf_counter() - began:.0f} s)", flush=True)

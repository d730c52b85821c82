"""Time 10,000 Monte Carlo draws of a two-parameter step fit of 1000 rows: `python -m bench.host.monte_carlo [DRAWS]`.

Aim: at most 10 s on 2 cores.
"""

from __future__ import annotations

import sys
import time

import numpy as np

from firmloop.identify.fitting.fit import fit
from firmloop.identify.fitting.redraw import redraw, white
from firmloop.identify.plants.kinds import make_plant
from firmloop.identify.recordings.conditioning import NONE
from firmloop.identify.recordings.recording import make_recording

MOMENTS = np.arange(1000) * 1e-3
DRIVE = np.where(MOMENTS >= 0.1, 115.0, 0.0)
SINCE = np.clip(MOMENTS - 0.1, 0.0, None)
TRUTH = {"gain": 0.79, "time_constant_s": 0.2}


def main(draws: int) -> None:
    random = np.random.default_rng(1)
    speed = 115 * TRUTH["gain"] * (1 - np.exp(-SINCE / TRUTH["time_constant_s"])) + random.normal(0, 1, 1000)
    recording = make_recording(MOMENTS, {"voltage_V": DRIVE, "speed_rad_s": speed}, "step", "")
    start = {"gain": 1.0, "time_constant_s": 0.3, "delay_s": {"value": 0.0, "free": False}}
    found = fit(make_plant("first_order", "voltage_V", ["speed_rad_s"], start), [recording], [], NONE)
    began, busy = time.perf_counter(), time.process_time()
    drawn = redraw(found, [recording], NONE, white, draws, 1, lambda share, doing: None)
    took, used = time.perf_counter() - began, time.process_time() - busy
    for parameter in found.plant.parameters[:2]:
        print(parameter.name, "covariance", parameter.interval_95, "Monte Carlo", drawn.interval_95(parameter.name))
    print(f"{draws} draws: {took:.1f} s, {used:.1f} s of processor")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 10_000)

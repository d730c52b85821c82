"""A fit of a long recording holds few arrays of its length beside it."""

from __future__ import annotations

import tracemalloc

import numpy as np
import scipy.signal

from firmloop.identify.fitting.evidence import Evidence, remainders
from firmloop.identify.fitting.fit import estimate
from firmloop.identify.plants.kinds import make_plant
from firmloop.identify.recordings.conditioning import NONE
from firmloop.identify.recordings.recording import make_recording

ROWS, PERIOD = 200_000, 1e-3
FITTED = 20  # columns of float64 at most: six of slopes, what they come from, and what their covariance takes
KEPT = 9  # time, residual, four slopes of parameters, two directions of the initial state; nothing beside them


def test_a_fit_and_what_it_leaves_take_few_columns_beside_the_recording() -> None:
    random = np.random.default_rng(0)
    drive = np.repeat(random.choice([-6.0, 0.0, 3.0, 6.0], ROWS // 200), 200)
    top, bottom, _ = scipy.signal.cont2discrete(([108.0], [1.0, 7.2, 36.0]), PERIOD, method="zoh")
    speed = scipy.signal.lfilter(np.ravel(top), bottom, drive) + 0.05 * random.standard_normal(ROWS)
    made = make_recording(PERIOD * np.arange(ROWS), {"u": drive, "y": speed}, "made", "")
    plant = make_plant("second_order", "u", ["y"], {})
    begun = plant.valued({"gain": 3.1, "natural_frequency_rad_s": 6.1, "damping_ratio": 0.61, "delay_s": 0.0})
    estimate(begun, [made], [], NONE, near=True)  # builds and loads what it needs
    tracemalloc.start()
    try:
        found = estimate(begun, [made], [], NONE, near=True)
        fit = tracemalloc.get_traced_memory()[1]
        held, _ = tracemalloc.get_traced_memory()
        left = remainders(Evidence(begun, (made,), NONE, found))
        kept, _ = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert left[0].residual.shape == (ROWS, 1)
    assert fit < FITTED * 8 * ROWS
    assert kept - held < KEPT * 8 * ROWS

"""Hold estimates against other libraries on the same data.

    python -m bench.host.second_library

- First- and second-order lags with noise, 20 recordings each: our least squares beside scipy.optimize.curve_fit of
  scipy.signal's own simulation. They agree where the second estimate lies inside our 95 % interval.
- The same second-order data by output error and by a subspace method (nfoursid): gain at rest and pole. They agree
  where they differ by no more than the 95 % interval of the difference, both drawn anew from their residuals.

Loops are compared in `bench/host/tuning.py`. Exit status 1 where a figure is outside.
"""

from __future__ import annotations

import sys

import numpy as np
import scipy.optimize
import scipy.signal
from numpy.typing import NDArray

from firmloop.identify.bench_tests.blackbox import STRUCTURES, Record, continuous, redrawn
from firmloop.identify.fitting.fit import fit
from firmloop.identify.plants.kinds import make_plant
from firmloop.identify.recordings.conditioning import NONE
from firmloop.identify.recordings.recording import make_recording

Array = NDArray[np.float64]

REPEATS, DRAWS, PERIOD, ROWS = 20, 20, 0.02, 400
TRUTH = {
    "first_order": {"gain": 3.0, "time_constant_s": 0.4},
    "second_order": {"gain": 3.0, "natural_frequency_rad_s": 6.0, "damping_ratio": 0.6},
}


def transfer(kind: str, values: Array) -> tuple[list[float], list[float]]:
    """Return numerator and denominator in s of a kind's parameters."""
    if kind == "first_order":
        gain, lag = values
        return [gain], [lag, 1.0]
    gain, natural, damping = values
    return [gain * natural**2], [1.0, 2 * damping * natural, natural**2]


def simulated(kind: str, values: Array, drive: Array) -> Array:
    """Simulate by scipy.signal, the input held between rows."""
    numerator, denominator, _ = scipy.signal.cont2discrete(transfer(kind, values), PERIOD)
    return np.asarray(scipy.signal.lfilter(numerator.ravel(), denominator, drive))


def recorded(kind: str, seed: int) -> tuple[Array, Array]:
    """Return input and noisy output of one recording."""
    random = np.random.default_rng(seed)
    drive = np.repeat(random.choice([-2.0, 2.0], ROWS // 20), 20)
    return drive, simulated(kind, np.array(list(TRUTH[kind].values())), drive) + random.normal(0, 0.1, ROWS)


def least_squares(kind: str) -> int:
    """Print one line a kind; return how many of curve_fit's estimates lie outside."""
    outside = np.zeros(len(TRUTH[kind]), dtype=int)
    apart = np.zeros(len(TRUTH[kind]))
    for seed in range(REPEATS):
        drive, output = recorded(kind, seed)
        made = make_recording(np.arange(ROWS) * PERIOD, {"u": drive, "y": output}, "simulated", "")
        asked = {name: {"value": 0.7 * value, "free": True} for name, value in TRUTH[kind].items()}
        plant = make_plant(kind, "u", ["y"], {**asked, "delay_s": {"value": 0.0, "free": False}})
        ours = fit(plant, [made], [], NONE).plant.parameters[: len(asked)]
        theirs, _ = scipy.optimize.curve_fit(
            lambda u, *values: simulated(kind, np.array(values), u), drive, output, [p["value"] for p in asked.values()]
        )
        for k, (one, other) in enumerate(zip(ours, theirs, strict=True)):
            interval = one.interval_95
            assert interval is not None
            outside[k] += not interval[0] <= other <= interval[1]
            apart[k] = max(apart[k], abs(one.value - other) / (interval[1] - interval[0]) * 2)
    for name, count, share in zip(TRUTH[kind], outside, apart, strict=True):
        print(f"{kind:13} {name:24} {REPEATS - count} of {REPEATS} inside; furthest {share:.2g} of the half width")
    return int(outside.sum())


def subspace() -> int:
    """Print gain and poles by both ways; return how many lie apart."""
    records = [Record("simulated", *recorded("second_order", 1))]
    found, drawn = [], []
    for structure in ("oe", "n4sid"):
        model = STRUCTURES[structure](records, 2, 0)
        found.append(figures(continuous(model, PERIOD)))
        drawn.append([figures(continuous(one, PERIOD)) for one in redrawn(structure, records, model, DRAWS)])
    half = 2.09 * np.hypot(*(np.std(one, axis=0, ddof=1) for one in drawn))  # Student, 20 draws
    for name, one, other, width in zip(("gain", "pole, real", "pole, imaginary"), *found, half, strict=True):
        print(
            f"subspace      {name:24} oe {one:.4g}, n4sid {other:.4g}: apart {abs(one - other):.2g}, within {width:.2g}"
        )
    return int(np.sum(np.abs(found[0] - found[1]) > half))


def figures(model: object) -> Array:
    """Return gain at rest, and real and imaginary part of the pole with the larger imaginary part."""
    a, b, c = (getattr(model, name) for name in "abc")
    pole = max(np.linalg.eigvals(a), key=lambda one: one.imag)
    return np.array([-c @ np.linalg.solve(a, b), pole.real, pole.imag])


def main() -> int:
    """Print both comparisons."""
    beyond = sum(least_squares(kind) for kind in TRUTH) + subspace()
    print("all agree" if not beyond else f"{beyond} figures do not agree")
    return int(beyond > 0)


if __name__ == "__main__":
    sys.exit(main())

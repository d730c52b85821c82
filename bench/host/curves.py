"""Measure how time and memory grow with rows, recordings, order and horizon, and print the exponents.

    python -m bench.host.curves                 every curve
    python -m bench.host.curves rows 1000000    one point of one

Each point is a run of its own. Time is processor time, as a ratio to a reference in the same run: NumPy's QR
decomposition of 100,000 rows and seven columns; memory is beyond what the run held before. The exponent between two
points is that of the size in the time. `rows` and `recordings` fit a second-order lag, `text` reads rows of three
columns with semicolons between them, `order` lowers and prints a dense state space in float32, `horizon` lowers and
prints a predictive controller of two states with limits on its move.

Exit status 1 where the time of a fit, or of reading, grows faster than rows times their logarithm, or its memory faster
than the rows.
"""

from __future__ import annotations

import io
import math
import resource
import subprocess
import sys
import time
from collections.abc import Callable, Mapping

import numpy as np
import scipy.signal

from bench.codegen.example_laws import dense_law
from bench.mpc.methods import LIMIT, RANGES, TABLE
from firmloop.codegen.emit import emit
from firmloop.design.kinds import design
from firmloop.identify.fitting.fit import estimate
from firmloop.identify.plants.kinds import make_plant
from firmloop.identify.recordings.conditioning import NONE
from firmloop.identify.recordings.formats.csv_text import read_csv
from firmloop.identify.recordings.recording import Recording, make_recording
from firmloop.identify.signal import Signal
from firmloop.quantize.lower.lower import lower

PERIOD = 0.001  # s
OF_MANY = 10_000  # rows of each of many recordings
REFERENCE = (100_000, 7)
SLACK = 0.1  # of an exponent, for the clock


def recording(rows: int, seed: int) -> Recording:
    """Return a recording of a second-order lag with noise."""
    random = np.random.default_rng(seed)
    drive = np.repeat(random.choice([-6.0, 0.0, 3.0, 6.0], rows // 200 + 1), 200)[:rows]
    top, bottom, _ = scipy.signal.cont2discrete(([108.0], [1.0, 7.2, 36.0]), PERIOD, method="zoh")
    clean = np.asarray(scipy.signal.lfilter(np.ravel(top), bottom, drive), np.float64)
    speed = clean + 0.05 * random.standard_normal(rows)
    return make_recording(PERIOD * np.arange(rows, dtype=np.float64), {"u": drive, "y": speed}, f"made {seed}", "")


def fit(rows: int, count: int) -> Callable[[], object]:
    """Return the fit of so many recordings, made ready."""
    made = [recording(rows, seed) for seed in range(count)]
    return lambda: estimate(make_plant("second_order", "u", ["y"], {}), made, [], NONE)


def text(rows: int) -> Callable[[], object]:
    """Return the reading of so many rows of text."""
    stream = io.BytesIO()  # a list of the lines would hold more memory than their reading takes
    stream.write(b"time_s;voltage_V;speed_rad_s\n")
    for k in range(rows):
        stream.write(b"%.3f;%d;%.4f\n" % (PERIOD * k, 6 * (k // 200 % 2), k * 7919 % 10007 / 16))
    content = stream.getvalue()
    return lambda: read_csv(content)


def print_order(order: int) -> Callable[[], object]:
    """Return what makes the C of a dense state space."""
    return lambda: emit(lower(dense_law(order), "float32"), "curves")


def print_horizon(horizon: int) -> Callable[[], object]:
    """Return what makes the C of a predictive controller."""
    table = {**TABLE, "horizon": horizon}
    inputs = tuple(Signal(name, unit, -size, size) for name, unit, size in RANGES)
    wires = inputs, (Signal("voltage", "V", -LIMIT, LIMIT),)
    return lambda: emit(lower(design("mpc", "servo", table, 0.01, *wires, None).law, "float32"), "curves")


CURVES: Mapping[str, tuple[tuple[int, ...], Callable[[int], Callable[[], object]]]] = {
    "rows": ((10_000, 100_000, 1_000_000, 10_000_000), lambda rows: fit(rows, 1)),
    "text": ((10_000, 100_000, 1_000_000), text),
    "recordings": ((1, 10, 100), lambda count: fit(OF_MANY, count)),
    "order": ((2, 5, 10, 20, 40), print_order),
    "horizon": ((5, 10, 20, 50, 100), print_horizon),
}


def measure(curve: str, size: int) -> None:
    """Print the ratio of times, the seconds and the megabytes of one point."""
    work = CURVES[curve][1](size)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    begun = time.process_time()
    work()
    seconds, most = time.process_time() - begun, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    given = np.random.default_rng(1).standard_normal(REFERENCE)
    begun = time.process_time()
    np.linalg.qr(given, mode="r")
    print(seconds / (time.process_time() - begun), seconds, (most - before) / 1e3)


def main() -> int:
    """Print every curve, each point from a process of its own, and judge how a fit grows."""
    if len(sys.argv) > 1:
        measure(sys.argv[1], int(sys.argv[2]))
        return 0
    missed = False
    for curve, (sizes, _) in CURVES.items():
        before: tuple[int, float, float] | None = None
        for size in sizes:
            call = [sys.executable, "-m", "bench.host.curves", curve, str(size)]
            done = subprocess.run(call, capture_output=True, text=True, check=False)
            if done.returncode:
                said = done.stderr.strip().splitlines() or [f"ended with status {done.returncode}"]
                print(f"{curve:10} {size:>11,}  {said[-1]}", flush=True)
                continue
            ratio, seconds, memory = map(float, done.stdout.split()[-3:])
            line = f"{curve:10} {size:>11,}  {ratio:9.1f} of the reference, {seconds:8.2f} s, {memory:7.0f} MB beyond"
            if before is not None:
                grown = math.log(size / before[0])
                time_by, memory_by = math.log(ratio / before[1]) / grown, math.log(memory / before[2]) / grown
                line += f"; exponents: time {time_by:.2f}, memory {memory_by:.2f}"
                allowed = 1.0 + math.log(math.log(size) / math.log(before[0])) / grown + SLACK if before[0] > 1 else 9.9
                missed |= curve in ("rows", "text") and (time_by > allowed or memory_by > 1.0 + SLACK)
            print(line, flush=True)
            before = size, ratio, max(memory, 1.0)
    return int(missed)


if __name__ == "__main__":
    sys.exit(main())

"""Measure a fit against the rows of its recording: time, and memory beyond what an empty program takes.

    python -m bench.host.long_recordings

A second-order lag with noise. Each line is a run of its own; the reference is NumPy's QR decomposition of a matrix of
as many rows and seven columns in that run, so that the ratio does not depend on the machine.
"""

from __future__ import annotations

import resource
import subprocess
import sys
import time

import numpy as np
import scipy.signal

from firmloop.identify.fitting.fit import estimate
from firmloop.identify.plants.kinds import make_plant
from firmloop.identify.recordings.conditioning import NONE
from firmloop.identify.recordings.recording import make_recording

ROWS = (10_000, 100_000, 1_000_000)
PERIOD = 0.001  # s


def measure(rows: int) -> None:
    """Print one line."""
    random = np.random.default_rng(1)
    drive = np.repeat(random.choice([-6.0, 0.0, 3.0, 6.0], rows // 200 + 1), 200)[:rows]
    top, bottom, _ = scipy.signal.cont2discrete(([108.0], [1.0, 7.2, 36.0]), PERIOD, method="zoh")
    speed = scipy.signal.lfilter(np.ravel(top), bottom, drive) + 0.05 * random.standard_normal(rows)
    recording = make_recording(np.arange(rows) * PERIOD, {"u": drive, "y": speed}, "made", "")
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
    begun = time.process_time()
    estimate(make_plant("second_order", "u", ["y"], {}), [recording], [], NONE)
    taken, most = time.process_time() - begun, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
    begun = time.process_time()
    np.linalg.qr(random.standard_normal((rows, 7)), mode="r")
    reference = time.process_time() - begun
    print(f"{rows:>9,} rows  {taken:7.2f} s, {taken / reference:6.0f} of the reference; {most - before:6.0f} MB beyond")


def main() -> int:
    """Run every size in a process of its own."""
    if len(sys.argv) > 1:
        measure(int(sys.argv[1]))
        return 0
    runs = [subprocess.run([sys.executable, "-m", "bench.host.long_recordings", str(rows)]) for rows in ROWS]
    return max(run.returncode for run in runs)


if __name__ == "__main__":
    sys.exit(main())

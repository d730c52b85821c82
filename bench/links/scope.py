"""Watch a controller in a browser at 1 kHz x 8 signals for 60 s: `python -m bench.links.scope [--seconds 60]`.

The controller runs on an emulated core; the seconds are of its time. Told are the samples lost, whether each number in
the page is the recording's, and what share of one processor page and server took. The exit status is 0 if no sample
was lost and no number another.
"""

from __future__ import annotations

import argparse
import os
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from bench.links.chromium import browsing, chromium
from bench.links.live import TANK
from firmloop.identify.recordings.recording import read_recording

ROOT = Path(__file__).parents[2]
SIGNALS = ("reference", "measurement", "output", "kp", "ki", "u_max", "u_min", "status")
TARGET = "qemu_mps2_an386"
PATIENCE = 120.0  # s for the page's address
PROJECT = """\
schema = 1
name = "tank"
[plant]
kind = "first_order"
input = "voltage_V"
outputs = ["temperature_C"]
[plant.parameters]
gain = { value = 40.0, free = true }
time_constant_s = { value = 0.1, free = true }
delay_s = { value = 0.0, free = false }
[controller]
kind = "pid"
period_s = 0.001
kp = 0.05
ki = 0.4
tunable = ["kp", "ki", "u_max", "u_min"]
[controller.ranges]
kp = [0.0, 0.2]
ki = [0.0, 5.0]
u_max = [1.0, 12.0]
u_min = [-12.0, -1.0]
[signals]
reference = { unit = "degC", low = -400, high = 400 }
measurement = { unit = "degC", low = -400, high = 400 }
output = { unit = "V", low = -12, high = 12 }
[arithmetic]
number = "float32"
"""


class Running:
    """A `firmloop scope` that runs as a process of its own."""

    def __init__(self, folder: Path, options: Sequence[str]) -> None:
        """Start it; wait for the address of its page."""
        (folder / "tank.toml").write_text(PROJECT)
        (folder / "tank.c").write_text(TANK.format(name="tank"))
        self.file = folder / "seen.csv"
        command = [*(sys.executable, "-m", "firmloop", "scope", "tank.toml", "--target", TARGET), *options]
        self._told = folder / "told"
        with self._told.open("w") as told, (folder / "said").open("w") as said:
            self.process = subprocess.Popen(
                [*command, "--signals", ",".join(SIGNALS), "--out", self.file.name],
                cwd=folder,
                env={**os.environ, "PYTHONPATH": str(ROOT)},
                stdout=said,
                stderr=told,
                process_group=0,
            )
        self.url = self._address()

    def told(self) -> str:
        """Return what it has said on stderr."""
        return self._told.read_text()

    def said(self) -> str:
        """Return what it has said on stdout."""
        return self._told.with_name("said").read_text()

    def stop(self, patience: float = 60.0) -> int:
        """Do as Ctrl-C does; return its exit status."""
        if self.process.poll() is None:
            os.killpg(self.process.pid, signal.SIGINT)
        return self.process.wait(patience)

    def _address(self) -> str:
        deadline = time.monotonic() + PATIENCE
        while time.monotonic() < deadline:
            found = re.search(r"open (http://\S+)\n", self.told())
            if found:
                return found.group(1)
            assert self.process.poll() is None, self.told()
            time.sleep(0.05)
        raise AssertionError(f"no page: {self.told()}")


@contextmanager
def scoping(folder: Path, *options: str) -> Iterator[Running]:
    """Run a scope on an emulated core, or with the options of another place."""
    scope = Running(folder, options if "--port" in options else ("--live", "tank.c", *options))
    try:
        yield scope
    finally:
        if scope.process.poll() is None:
            scope.process.kill()
            scope.process.wait()


def processor_seconds(number: int) -> float:
    """Return how long processors have worked for a process."""
    fields = Path(f"/proc/{number}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=60.0, help="of the controller's time")
    seconds = parser.parse_args().seconds
    if chromium() is None:
        print("no browser here: apt-get install chromium")
        return 3
    with tempfile.TemporaryDirectory() as folder, scoping(Path(folder)) as scope, browsing() as browser:
        browser.open(scope.url)
        browser.wait("store.length > 1000")
        begun, page, server = time.perf_counter(), browser.seconds(), processor_seconds(scope.process.pid)
        first = int(str(browser.ask("store.base + store.length")))
        browser.wait(f"store.base + store.length >= {first + seconds / 1e-3}", 20 * seconds + 60)
        wall = time.perf_counter() - begun
        page, server = browser.seconds() - page, processor_seconds(scope.process.pid) - server
        status = scope.stop()
        browser.wait("over !== ''")
        missing = int(str(browser.ask("missing")))
        columns = browser.ask("store.columns.map((column) => Array.from(column.subarray(0, store.length)))")
        recording = read_recording(scope.file, {})
    shown = np.array(columns)
    kept = np.array([np.round(recording.time / 1e-3), *recording.columns.values()])
    base = kept.shape[1] - shown.shape[1]
    differ = int((shown != kept[:, base:]).sum()) if base >= 0 else shown.size
    print(
        f"{kept.shape[1]:,} samples of {len(SIGNALS)} signals, {seconds:g} s of the controller's time in {wall:.1f} s; "
        f"lost: {missing}; of {shown.size:,} numbers in the page, {differ} are not the recording's; processor: page "
        f"{100 * page / wall:.1f} %, firmloop {100 * server / wall:.1f} % (of the controller's time "
        f"{100 * page / seconds:.1f} % and {100 * server / seconds:.1f} %); status {status}"
    )
    return int(missing > 0 or differ > 0 or status != 0)


if __name__ == "__main__":
    raise SystemExit(main())

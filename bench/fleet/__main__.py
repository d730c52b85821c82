"""Diagnose a made fleet through the command line, killed at half and resumed, and count who is named.

    python -m bench.fleet                          200 motors, 20 of them with one of five faults
    python -m bench.fleet --machines 40 --faulty 5
    python -m bench.fleet --cluster                besides: a Dask cluster of one worker, and of two

A hit is a machine with a fault that is listed, and the fault is among what is said of it. Exit status 1 when more than
one in twenty is missed, more than one machine is listed that is like the others, or a result is lost.
"""

from __future__ import annotations

import argparse
import json
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

from bench.fleet.machines import FAULTS, make_fleet, write_fleet

CLUSTER = """
from distributed import LocalCluster
if __name__ == "__main__":
    kept = LocalCluster(n_workers={count}, threads_per_worker=1, dashboard_address=None)
    print(kept.scheduler_address, flush=True)
    input()
"""


def command(project: Path, out: Path) -> list[str]:
    words = [sys.executable, "-m", "firmloop", "diagnose", str(project), "--fleet", str(project.parent / "recordings")]
    return [*words, "--out", str(out)]


def results(out: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in (out / "machines").glob("*.json")}


def killed(project: Path, out: Path, count: int) -> dict[str, bytes]:
    """Run until `count` results are there, and kill it."""
    process = subprocess.Popen(command(project, out), stderr=subprocess.DEVNULL)
    while len(results(out)) < count and process.poll() is None:
        time.sleep(0.1)
    process.send_signal(signal.SIGKILL)
    process.wait()
    return results(out)


def on_cluster(project: Path, out: Path, count: int) -> float:
    """Return how long a cluster takes, in s, without its start."""
    with tempfile.TemporaryDirectory() as folder:
        script = Path(folder) / "cluster.py"
        script.write_text(CLUSTER.format(count=count))
        pipe = subprocess.PIPE
        cluster = subprocess.Popen([sys.executable, str(script)], stdin=pipe, stdout=pipe, text=True)
        assert cluster.stdout is not None
        address = cluster.stdout.readline().strip()
        begun = time.monotonic()
        subprocess.run([*command(project, out), "--dask", address], stdout=subprocess.DEVNULL, check=False)
        took = time.monotonic() - begun
        cluster.communicate("\n")
    return took


def counted(faults: Sequence[str], found: dict[str, object]) -> tuple[int, int]:
    """Print a line for each machine with a fault, and for each that is listed without one; count both kinds."""
    listed: dict[str, list[str]] = {}
    assert isinstance(found["different"], list)
    for one in found["different"]:
        said = [each["name"] for each in one["effects"]] + [each["figure"] for each in one["departures"]]
        listed[one["machine"]] = said
    hits = false = 0
    for k, fault in enumerate(faults):
        said = listed.get(f"m{k:03}")
        if not fault and said is None:
            continue
        hit = bool(fault and said and set(said) & set(FAULTS[fault][1]))
        hits, false = hits + hit, false + (not fault)
        print(f"  m{k:03}  {fault or 'nothing':24} {'hit' if hit else 'MISSED' if fault else 'FALSE':7} {said or ''}")
    return hits, false


def main() -> int:
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("--machines", type=int, default=200)
    asked.add_argument("--faulty", type=int, default=20)
    asked.add_argument("--seed", type=int, default=1)
    asked.add_argument("--cluster", action="store_true")
    given = asked.parse_args()
    fleet = make_fleet(given.machines, given.faulty, given.seed)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        project, out = write_fleet(folder, fleet, given.seed), folder / "out"
        begun = time.monotonic()
        kept = killed(project, out, given.machines // 2)
        half = time.monotonic()
        subprocess.run(command(project, out), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, check=False)
        ended = time.monotonic()
        whole = results(out)
        lost = sum(whole.get(name) != text for name, text in kept.items())
        hits, false = counted(fleet.faults, json.loads((out / "fleet.json").read_text()))
        print(f"{given.machines} motors, {given.faulty} with a fault: {hits} named, {false} false")
        print(f"killed with {len(kept)} results after {half - begun:.0f} s, resumed: {ended - half:.0f} s; {lost} lost")
        short = lost or len(whole) < given.machines
        if given.cluster:
            times = [on_cluster(project, folder / f"cluster_{count}", count) for count in (1, 2)]
            short = short or any(results(folder / f"cluster_{count}") != whole for count in (1, 2))
            print(f"Dask: one worker {times[0]:.0f} s, two {times[1]:.0f} s: {times[0] / times[1]:.2f} times as fast")
    return 1 if short or false > 1 or hits < 0.95 * given.faulty else 0


if __name__ == "__main__":
    sys.exit(main())

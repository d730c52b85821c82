"""A watch that is stopped keeps what it has, and one without a sample leaves nothing."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from bench.links.live import TANK
from bench.links.scope import PROJECT, ROOT, TARGET
from firmloop.identify.recordings.recording import read_recording


def monitoring(folder: Path, *options: str) -> subprocess.Popen[str]:
    """Start `firmloop monitor` in a process of its own."""
    (folder / "tank.toml").write_text(PROJECT)
    (folder / "tank.c").write_text(TANK.format(name="tank"))
    command = [
        sys.executable,
        "-m",
        "firmloop",
        "monitor",
        "tank.toml",
        "--target",
        TARGET,
        "--out",
        "seen.csv",
        *options,
    ]
    return subprocess.Popen(
        command,
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        process_group=0,
    )


@pytest.mark.qemu
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_monitor_that_is_stopped_keeps_what_it_has(tmp_path: Path, number: signal.Signals) -> None:
    process = monitoring(tmp_path, "--live", "tank.c", "--seconds", "600")
    assert process.stderr is not None
    for line in process.stderr:  # told every few seconds while samples come
        if "steps" in line:
            break
    os.killpg(process.pid, number)
    said, told = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "stopped; seen.csv holds what came before" in told
    assert "lost:" in said and "steps, " in said
    assert len(read_recording(tmp_path / "seen.csv", {}).time) > 1
    assert {path.name for path in tmp_path.iterdir()} == {"tank.toml", "tank.c", "seen.csv"}


def test_a_monitor_that_is_stopped_before_a_sample_leaves_nothing(tmp_path: Path) -> None:
    process = monitoring(tmp_path, "--live", "tank.c")
    time.sleep(0.5)
    os.killpg(process.pid, signal.SIGINT)
    _, told = process.communicate(timeout=60)
    assert process.returncode in (130, -signal.SIGINT), told  # by the signal while Python itself starts
    assert not (tmp_path / "seen.csv").exists()

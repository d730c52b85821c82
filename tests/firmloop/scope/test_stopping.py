"""A watch that is stopped keeps what it has, and one without a sample leaves nothing."""

from __future__ import annotations

import os
import pty
import re
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import pytest

from bench.links.live import TANK
from bench.links.scope import PROJECT, ROOT, TARGET
from firmloop.cli import main
from firmloop.identify.recordings.recording import read_recording


def monitoring(folder: Path, *options: str, told: int = subprocess.PIPE) -> subprocess.Popen[str]:
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
        stderr=told,
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


@pytest.mark.qemu
def test_a_monitor_draws_on_a_terminal_while_it_runs(tmp_path: Path) -> None:
    ours, theirs = pty.openpty()
    process = monitoring(tmp_path, "--live", "tank.c", "--seconds", "600", told=theirs)
    os.close(theirs)
    seen = b""
    while seen.count(b"voltage_V |") < 3:
        seen += os.read(ours, 1 << 14)
    os.killpg(process.pid, signal.SIGINT)
    with suppress(OSError):  # the terminal has gone with its last writer
        while part := os.read(ours, 1 << 14):
            seen += part
    os.close(ours)
    process.communicate(timeout=60)
    frames = seen.decode().split("\r\x1b[Kwatching")[1:]
    drawn = [line for line in frames[-2].split("\x1b[3A")[0].splitlines() if "|" in line]
    assert [line.removeprefix("\x1b[K").split()[0] for line in drawn] == ["reference_C", "temperature_C", "voltage_V"]
    assert [line.split()[-1] for line in drawn] == ["degC", "degC", "V"]
    assert max(map(len, drawn)) < 80 + len("\x1b[K")
    assert frames[0].count("\n") == 3 and "\x1b[3A" in frames[0]
    assert "\x1b[J" in frames[-1] and "stopped; seen.csv holds what came before" in frames[-1]


@pytest.mark.qemu
def test_a_signal_that_is_no_number_for_a_while_is_watched_and_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    lost = "volatile float zero = 0.0F; in->measurement = (count % 100U < 20U) ? 1.0F / zero : level;"
    tank = TANK.format(name="tank").replace("in->measurement = level;", lost)
    (tmp_path / "tank.toml").write_text(PROJECT)
    (tmp_path / "tank.c").write_text(tank)
    asked = ["monitor", str(tmp_path / "tank.toml"), "--target", TARGET, "--live", str(tmp_path / "tank.c")]
    assert main([*asked, "--seconds", "0.4", "--out", str(tmp_path / "seen.csv")]) == 0
    said = capsys.readouterr().out
    assert re.search(r"temperature_C: \d+ samples are nan or infinite, the first at [\d.]+ s, drawn as !", said), said
    assert re.search(r"temperature_C \|[^|]*[^!|]!+[^!|]", said) and re.search(r"reference_C \|[^!|]+\|", said), said

"""A slice of bench/links/faults.py, and what the whole command does when the far end is not what it should be."""

from __future__ import annotations

import ctypes
import os
import pty
import random
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from bench.links.faults import ATTEMPTS, TIMEOUT, run
from firmloop.cli import main
from firmloop.verify.link import LinkError
from firmloop.verify.links import uart
from firmloop.verify.links.framed import FramedLink
from tests.verify.boards import ONE_STEP, PROGRAM, RESULT
from tests.verify.links.wild import WildLine, build_image_library

PATIENCE = 600.0  # s, for what takes a few on a machine with time to spare
PROJECT = """\
schema = 1
name = "wheel"
[controller]
kind = "pid"
period_s = 0.001
kp = 0.05
ki = 1.4
[signals]
reference = { unit = "rad/s", low = -400, high = 400 }
measurement = { unit = "rad/s", low = -400, high = 400 }
output = { unit = "V", low = -12, high = 12 }
[arithmetic]
number = "fixed"
bits = 32
[target]
names = ["nucleo_f411re"]
"""


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    return build_image_library(tmp_path_factory.mktemp("image"))


@pytest.mark.parametrize("share", [0.02, 0.15, 0.4])
def test_no_wrong_value_and_no_hang(share: float, library: ctypes.CDLL) -> None:
    library.image_reset()
    line = WildLine(library, share, seed=7)
    tally = run(line, library, 5_000, seed=7)
    assert tally.harmed > 100 and tally.restarts == 5 and tally.resets_noticed >= 1
    assert tally.wrong == 0
    assert tally.clean_repeats <= 1
    assert tally.longest <= TIMEOUT * ATTEMPTS
    assert tally.given_up == 0 or share > 0.15


def test_a_host_whose_session_another_took_over_is_told(library: ctypes.CDLL) -> None:
    line, dice = WildLine(library, 0.0, seed=0), random.Random(0)
    first, second = (FramedLink(line, "wild line", PROGRAM.id, 1.0, 4, line.clock, dice.randbytes) for _ in range(2))
    with pytest.raises(LinkError, match="wild line: the image knows nothing of this session"):
        first.step(ONE_STEP(1.0, 0.0), 1)
    assert line.now <= 4.0
    second.reset()
    assert np.frombuffer(second.step(ONE_STEP(1.0, 0.0), 1), RESULT)["sum"] == 1.0


@contextmanager
def garbage() -> Iterator[str]:
    """A port that answers whatever comes with what a wrong baud rate makes of it."""
    master, slave = pty.openpty()
    dice = random.Random(1)

    def answer() -> None:
        while True:
            try:
                count = len(os.read(master, 4096))
                os.write(master, dice.randbytes(count))
            except OSError:
                return

    thread = threading.Thread(target=answer)
    thread.start()
    try:
        yield os.ttyname(slave)
    finally:
        os.close(slave)  # ends what the thread reads
        thread.join()
        os.close(master)


def test_a_wrong_baud_rate_ends_with_status_3(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(uart, "PORT_TIMEOUT", 0.3)
    (tmp_path / "wheel.toml").write_text(PROJECT)
    with garbage() as port:
        status = main(["verify", str(tmp_path / "wheel.toml"), "--out", str(tmp_path / "out"), "--port", port])
    assert status == 3
    assert "no reply within 4 attempts of 0.3 s: check that the image runs, the baud rate" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_board_without_its_port_says_what_to_give(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "wheel.toml").write_text(PROJECT)
    assert main(["verify", str(tmp_path / "wheel.toml"), "--out", str(tmp_path / "out"), "--steps", "100"]) == 3
    assert "give the port of the board with --port" in capsys.readouterr().err


def start_verify(folder: Path, steps: int, built: Path) -> subprocess.Popen[str]:
    """Start a verification in QEMU as a program of its own, whose temporary files are in `folder`; `built` is kept."""
    (folder / "wheel.toml").write_text(PROJECT)
    command = [sys.executable, "-m", "firmloop", "verify", str(folder / "wheel.toml"), "--out", str(folder / "out")]
    return subprocess.Popen(
        [*command, "--target", "qemu_mps2_an386", "--steps", str(steps)],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        env={
            **os.environ,
            "TMPDIR": str(folder),
            "XDG_CACHE_HOME": str(built),
            "PYTHONPATH": str(Path(__file__).parents[3]),
        },
    )


def emulators(folder: Path) -> list[int]:
    """Look for the emulators that run in a private folder there."""
    return [int(each.name) for each in Path("/proc").iterdir() if each.name.isdigit() and emulates(each, folder)]


def emulator_of(host: int, folder: Path, deadline: float) -> int:
    """Wait for the emulator that a process starts, which runs in a private folder there; 0 where time is up."""
    children = Path(f"/proc/{host}/task")
    while time.monotonic() < deadline:
        for started in children.glob("*/children"):
            for name in started.read_text().split():
                if emulates(Path("/proc", name), folder):
                    return int(name)
        time.sleep(0.02)
    return 0


def emulates(process: Path, folder: Path) -> bool:
    """Tell whether a process is an emulator that has its line in a folder there; one that has ended is none."""
    try:
        ours = "qemu" in (process / "comm").read_text() and str(folder) in os.readlink(process / "cwd")
        return ours and "pipe:" in " ".join(os.readlink(file) for file in (process / "fd").iterdir())
    except OSError:
        return False


@pytest.mark.qemu
@pytest.mark.parametrize("victim", ["emulator", "host"])
def test_who_is_killed_midway_leaves_nothing_and_the_next_run_works(victim: str, tmp_path: Path, built: Path) -> None:
    with start_verify(tmp_path, 200_000, built) as run_midway:  # seconds on the emulator: it is killed at once
        emulator = emulator_of(run_midway.pid, tmp_path, time.monotonic() + PATIENCE)
        assert emulator, "no emulator came up"
        os.kill(emulator if victim == "emulator" else run_midway.pid, signal.SIGKILL)
        _, said = run_midway.communicate(timeout=PATIENCE)
    if victim == "emulator":
        assert run_midway.returncode == 3
        assert "QEMU ended with status -9; run again" in said
        assert not [*tmp_path.glob("firmloop*")]
    assert not (tmp_path / "out").exists()
    deadline = time.monotonic() + PATIENCE
    while emulators(tmp_path) and time.monotonic() < deadline:
        time.sleep(0.02)
    assert not emulators(tmp_path)
    with start_verify(tmp_path, 500, built) as again:
        again.communicate(timeout=PATIENCE)
    assert again.returncode == 0 and (tmp_path / "out" / "verdict.json").is_file()

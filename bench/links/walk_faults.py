"""Do to a whole verification what may happen on a desk, and say how it ends: `python -m bench.links.walk_faults`.

Each row is a command of its own; after it, nothing of ours may run and the same command must agree. The exit status is
the number of rows that did not end so.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

from firmloop.codegen.firmware import firmware
from firmloop.codegen.target import load_target
from firmloop.project.project import read_project
from firmloop.stages.making import Generated, design, generate
from firmloop.verify.build.image import build_image
from firmloop.verify.links.pty import start_on_terminal
from firmloop.verify.links.qemu import QemuProcess
from tests.verify.links.test_faults import PROJECT, garbage

TARGET = load_target("qemu_mps2_an386")
LONG, SHORT = 1_000_000, 500  # steps: not done before something happens; done at once
LONG_ON_LINE = 50_000
PATIENCE = 600.0  # s for any of them, on a busy machine


class Desk:
    """A folder with the project in it; all that is started has its temporary files there."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.started: list[subprocess.Popen[str]] = []
        self.project = folder / "wheel.toml"
        self.project.write_text(PROJECT)
        self.other = folder / "other.toml"
        self.other.write_text(PROJECT.replace("ki = 1.4", "ki = 1.5"))

    def start(self, steps: int, *more: str) -> subprocess.Popen[str]:
        """Start one verification."""
        command = [sys.executable, "-m", "firmloop", "verify", str(self.project), "--target", TARGET.name]
        started = subprocess.Popen(
            [*command, "--out", str(self.folder / "out"), "--steps", str(steps), *more],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env={**os.environ, "TMPDIR": str(self.folder)},
        )
        self.started.append(started)
        return started

    def end(self) -> None:
        """End what was started and has not ended, because a row broke off."""
        for command in self.started:
            command.kill()
            command.wait()

    def emulators(self) -> list[int]:
        """Processes that run in a temporary folder of this desk and are no compiler."""
        found = []
        for process in Path("/proc").iterdir():
            try:
                if process.name.isdigit() and (process / "comm").read_text().startswith("qemu-system"):
                    if str(self.folder) in os.readlink(process / "cwd"):
                        found.append(int(process.name))
            except OSError:
                continue
        return found

    def wait_for_emulator(self) -> int:
        """Wait until one runs, and a moment more: it is then in the middle of it."""
        deadline = time.monotonic() + PATIENCE
        while not self.emulators():
            assert time.monotonic() < deadline, "no emulator came up"
            time.sleep(0.01)
        time.sleep(0.3)
        return self.emulators()[0]

    @contextmanager
    def board(self, project: Path) -> Iterator[tuple[str, QemuProcess]]:
        """Run the image of `project` behind a terminal, as a board that somebody flashed."""
        read = read_project(project)
        made: Generated = generate(read, design(read, None), "firmloop verify")
        with tempfile.TemporaryDirectory() as folder:
            image = build_image(firmware(made.program, made.bundle, TARGET, "uart"), TARGET, Path(folder))
            process, port = start_on_terminal(TARGET, image.elf)
            try:
                yield port, process
            finally:
                process.stop()


def emulator_killed(desk: Desk, *more: str) -> subprocess.Popen[str]:
    command = desk.start(LONG if not more else LONG_ON_LINE, *more)
    os.kill(desk.wait_for_emulator(), signal.SIGKILL)
    return command


def uart_killed(desk: Desk) -> subprocess.Popen[str]:
    return emulator_killed(desk, "--port", "uart")


def terminal_closed(desk: Desk) -> subprocess.Popen[str]:
    with desk.board(desk.project) as (port, process):
        command = desk.start(LONG_ON_LINE, "--port", port)
        wait_for_use(command, port)
        process.stop()
        command.wait(PATIENCE)
    return command


def other_image(desk: Desk) -> subprocess.Popen[str]:
    with desk.board(desk.other) as (port, _):
        command = desk.start(SHORT, "--port", port)
        command.wait(PATIENCE)
    return command


def wrong_baud(desk: Desk) -> subprocess.Popen[str]:
    with garbage() as port:
        command = desk.start(SHORT, "--port", port)
        command.wait(PATIENCE)
    return command


def host_terminated(desk: Desk) -> subprocess.Popen[str]:
    command = desk.start(LONG)
    desk.wait_for_emulator()
    command.send_signal(signal.SIGTERM)
    return command


def host_killed(desk: Desk) -> subprocess.Popen[str]:
    command = desk.start(LONG)
    desk.wait_for_emulator()
    command.kill()
    return command


def host_killed_on_a_port(desk: Desk) -> subprocess.Popen[str]:
    """The image runs on: the next host greets it in the middle of what the last one asked."""
    with desk.board(desk.project) as (port, _):
        command = desk.start(LONG_ON_LINE, "--port", port)
        wait_for_use(command, port)
        command.kill()
        command.wait(PATIENCE)
        again = desk.start(SHORT, "--port", port)
        again.wait(PATIENCE)
    return again


def wait_for_use(command: subprocess.Popen[str], port: str) -> None:
    """Wait until the command has the port open, and a moment more."""
    deadline = time.monotonic() + PATIENCE
    while command.poll() is None:
        assert time.monotonic() < deadline, "the port was not opened"
        with suppress(OSError):  # it may close one while we look
            if port in (os.readlink(file) for file in Path(f"/proc/{command.pid}/fd").iterdir()):
                break
        time.sleep(0.01)
    time.sleep(0.3)


ROWS: tuple[tuple[str, Callable[[Desk], subprocess.Popen[str]], int], ...] = (
    ("QEMU killed, pipes", emulator_killed, 3),
    ("QEMU killed, UART", uart_killed, 3),
    ("pseudo-terminal closed", terminal_closed, 3),
    ("image of another program", other_image, 3),
    ("wrong baud rate", wrong_baud, 3),
    ("host stopped by SIGTERM", host_terminated, 130),
    ("host killed, emulator", host_killed, -9),
    ("host killed, port; again", host_killed_on_a_port, 0),
)


def main() -> int:
    wrong = 0
    for name, act, wanted in ROWS:
        with tempfile.TemporaryDirectory() as folder, ExitStack() as undo:
            desk = Desk(Path(folder))
            undo.callback(desk.end)
            begin = time.monotonic()
            _, said = (command := act(desk)).communicate(timeout=PATIENCE)
            took = time.monotonic() - begin
            while desk.emulators() and time.monotonic() - begin < took + 5.0:
                time.sleep(0.01)  # the kernel ends what a killed host started
            left = len(desk.emulators())
            again = desk.start(SHORT)
            again.communicate(timeout=PATIENCE)
        good = (command.returncode, left, again.returncode) == (wanted, 0, 0)
        wrong += not good
        last = (said.strip().splitlines() or [""])[-1][:150]
        print(
            f"{'ok ' if good else 'BAD'} {name:26} status {command.returncode:3} in {took:5.1f} s; "
            f"left running: {left}; next run: status {again.returncode}; {last}",
            flush=True,
        )
    return wrong


if __name__ == "__main__":
    raise SystemExit(main())

"""A QEMU that cannot outlive the session that started it."""

from __future__ import annotations

import select
import shutil
import subprocess
import weakref
from collections.abc import Sequence
from contextlib import suppress
from functools import cache
from pathlib import Path

from firmloop.codegen.target import Qemu, Target
from firmloop.identify.simulation.compiler import find_tool
from firmloop.identify.simulation.scratch import Scratch
from firmloop.verify.link import LinkError, fault_says

PATIENCE = 1.0  # s for an emulator to end by itself before it is killed
_PROBE = 20.0  # s; QEMU lists its machines in some 0.05 s
QUOTED = 300  # characters of its words in a message; the first ones tell most


class QemuProcess:
    """A running emulator and its private folder, which it runs in and which goes when it goes."""

    def __init__(
        self, qemu: Qemu, elf: Path, arguments: Sequence[str], descriptors: Sequence[int], scratch: Scratch
    ) -> None:
        """Start it.

        Parameters
        ----------
        arguments
            of its command line, beside machine, clock and image
        descriptors
            open descriptors that it inherits
        scratch
            a private folder; taken over
        """
        if not hasattr(select, "poll"):
            raise LinkError(
                "not supported here: an emulator needs inherited descriptors and poll(), which this system lacks; "
                "run it under Linux (on Windows: WSL), or name a board with --port"
            )
        program = find_tool(qemu.program)
        command = [
            *_ended_with_parent(),
            str(program),
            *_without_programs(program),
            # No firmware: the image is what the machine starts with.
            *("-machine", qemu.machine, "-bios", "none", "-display", "none", "-monitor", "none"),
            # Instructions are the clock: the same image counts the same ticks on any machine.
            *("-icount", f"shift={qemu.icount_shift}"),
            *arguments,
            *("-kernel", str(elf.resolve())),
        ]
        self.machine = qemu.machine
        self._words = scratch.path / "words"
        with self._words.open("wb") as words:
            self._process = subprocess.Popen(
                command,
                cwd=scratch.path,
                stdin=subprocess.DEVNULL,
                stdout=words,
                stderr=words,
                pass_fds=descriptors,
                process_group=0,  # Ctrl-C is for us: we end it once we have what it still has to say
            )
        self.number = self._process.pid  # setpriv becomes QEMU, it does not start it
        # Also runs when the interpreter ends, so that an unclosed link leaves nothing behind.
        self._end = weakref.finalize(self, _end, self._process, scratch)

    def running(self) -> bool:
        """Say whether it runs."""
        return self._process.poll() is None

    def words(self) -> str:
        """Return what it has said so far."""
        return self._words.read_text(errors="replace") if self._words.exists() else ""

    def fate(self) -> str:
        """Say how it ended, in its own words."""
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(PATIENCE)
        status = self._process.poll()
        words = " ".join(self.words().split())
        quoted = f": {words[:QUOTED]}" if words else ""
        if status is None:
            return f"QEMU still runs but its line is closed{quoted}"
        if words.startswith("FAULT "):
            return fault_says(words[:QUOTED])
        return f"QEMU ended with status {status}{quoted}; run again"

    def finish(self) -> None:
        """Give it a moment to end by itself, because its line was closed; then stop it."""
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(PATIENCE)
        self.stop()

    def stop(self) -> None:
        """Kill it, wait until it is gone, and remove its folder; a second call does nothing."""
        self._end()


def qemu_of(target: Target) -> Qemu:
    """Return how QEMU stands in for the target, or raise LinkError if it does not."""
    if target.qemu is None:
        raise LinkError(
            f"target {target.name} has no [qemu] table: give the port of the board with --port; "
            "to see the ports: firmloop targets --ports"
        )
    return target.qemu


def _ended_with_parent() -> tuple[str, ...]:
    """Return the prefix that has the kernel end QEMU when we are killed and cannot; util-linux has it on any Linux."""
    setpriv = shutil.which("setpriv")
    return (setpriv, "--pdeathsig", "KILL") if setpriv else ()


@cache
def _without_programs(program: Path) -> tuple[str, ...]:
    """Return the options that keep QEMU from starting a program, as an image could ask for by semihosting's SYSTEM.

    Empty where this QEMU was built without seccomp, or the kernel has none.
    """
    options = ("-sandbox", "on,spawn=deny")
    try:
        done = subprocess.run(
            [str(program), *options, "-machine", "help"], capture_output=True, timeout=_PROBE, check=False
        )
    except (OSError, subprocess.TimeoutExpired):
        return ()
    return options if done.returncode == 0 else ()


def _end(process: subprocess.Popen[bytes], scratch: Scratch) -> None:
    # Not SIGTERM: while the image waits in a semihosting read, QEMU does not hear it.
    process.kill()
    process.wait()
    scratch.remove()

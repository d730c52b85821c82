"""A line at its worst, in time that is only counted, between the image's real code and the host's real half."""

from __future__ import annotations

import ctypes
import random
from collections.abc import Callable
from pathlib import Path

from firmloop.codegen.bundle import write_files
from firmloop.codegen.firmware import WARNINGS, firmware
from firmloop.identify.simulation.compiler import run_compiler
from tests.verify.boards import BUNDLE, C_TESTS, PROGRAM, TARGET

STALL = 5.0  # s, longer than the host waits for a reply
Damage = Callable[[bytes, random.Random], bytes]


def build_image_library(folder: Path) -> ctypes.CDLL:
    """Compile main.c and frame.c of the tiny controller for this process."""
    files = dict(firmware(PROGRAM, BUNDLE, TARGET, "uart"))
    for name in [name for name in files if name.startswith("board/") and name.endswith(".c")]:
        del files[name]
    files["board_library.c"] = (C_TESTS / "board_library.c").read_text()
    write_files(files, folder)
    sources = [name for name in files if name.endswith(".c") and name != "main.c"]
    run_compiler(["gcc", "-std=c99", "-O2", "-shared", "-fPIC", *WARNINGS, *sources, "-o", "image.so"], folder)
    library = ctypes.CDLL(str(folder / "image.so"))
    library.image_take.restype = ctypes.c_size_t
    return library


def flip(data: bytes, dice: random.Random) -> bytes:
    damaged = bytearray(data)
    for _ in range(dice.choice((1, 1, 2, 3, 8))):
        damaged[dice.randrange(len(data))] ^= 1 << dice.randrange(8)
    return bytes(damaged)


def drop(data: bytes, dice: random.Random) -> bytes:
    place, count = dice.randrange(len(data)), dice.choice((1, 1, 2, 5))
    return data[:place] + data[place + count :]


def double(data: bytes, dice: random.Random) -> bytes:
    place = dice.randrange(len(data))
    return dice.choice((data + data, data[:place] + data[place : place + 1] + data[place:]))


def cut(data: bytes, dice: random.Random) -> bytes:
    return data[: dice.randrange(len(data))]


def junk(data: bytes, dice: random.Random) -> bytes:
    return dice.randbytes(dice.randrange(1, 80)) + data + dice.randbytes(dice.randrange(80))


def lose(data: bytes, dice: random.Random) -> bytes:
    return b""


DAMAGES: tuple[Damage, ...] = (flip, drop, double, cut, junk, lose)


class WildLine:
    """A stream that damages, holds back, swaps and stalls what passes, in time that it counts itself."""

    def __init__(self, library: ctypes.CDLL, share: float, seed: int) -> None:
        self.now = 0.0  # s
        self.sent = 0  # requests of the host
        self.harmed = 0  # passages, either way, that something was done to
        self.share = share
        self._library = library
        self._dice = random.Random(seed)
        self._buffer = ctypes.create_string_buffer(1 << 20)
        self._arriving: list[tuple[float, bytes]] = []  # to the host: when, and what
        self._swapped = b""  # a request that the next one overtakes

    def clock(self) -> float:
        """Return the counted time."""
        return self.now

    def write(self, data: bytes) -> None:
        """Carry bytes to the image, and what it says to that onto the way back."""
        self.sent += 1
        data = self._pass(data)
        late, self._swapped = self._swapped, b""
        if data and self._dice.random() < self.share / 4:
            self.harmed += 1
            self._swapped = data
            data = b""
        for part in (data, late):
            self._library.image_feed(part, ctypes.c_size_t(len(part)))
        count = self._library.image_take(self._buffer)
        said = self._pass(self._buffer.raw[:count])
        if said:
            stalled = self._dice.random() < self.share / 4
            self.harmed += stalled
            self._arriving.append((self.now + (STALL if stalled else 0.0), said))

    def read(self, timeout: float) -> bytes:
        """Return what has arrived, or wait for it in counted time."""
        due = min((when for when, _ in self._arriving), default=self.now + timeout)
        if due > self.now + timeout or not self._arriving:
            self.now += timeout
            return b""
        self.now = max(self.now, due)
        arrived = b"".join(data for when, data in self._arriving if when <= self.now)
        self._arriving = [(when, data) for when, data in self._arriving if when > self.now]
        return arrived

    def close(self) -> None:
        """Leave the image as it is: a host that went away."""

    def _pass(self, data: bytes) -> bytes:
        if data and self._dice.random() < self.share:
            self.harmed += 1
            return self._dice.choice(DAMAGES)(data, self._dice)
        return data

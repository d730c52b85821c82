"""Byte streams that a framed link runs over: a pair of descriptors, or whatever pyserial opens."""

from __future__ import annotations

import io
import math
import os
import select
import threading
import time
import warnings
from collections.abc import Callable
from contextlib import suppress
from typing import Protocol

import serial

from firmloop.identify.simulation.compiler import ToolError
from firmloop.verify.link import LinkError
from firmloop.verify.links.exchange import Exchange
from firmloop.verify.links.turns import PipeTurns, Turns

CHUNK = 1 << 13  # bytes asked for at once; a larger buffer costs more to get than it saves
ALARM_PERIOD = 0.1  # s between looks of the alarm


class Stream(Protocol):
    """Bytes to and from the far end; a fault of the line is a LinkError."""

    def write(self, data: bytes) -> None:
        """Send all of `data`."""

    def read(self, timeout: float) -> bytes:
        """Return the bytes that are there, or come within `timeout` seconds; none if none came."""

    def close(self) -> None:
        """Let go of the line and of what was started for it."""


class DescriptorStream:
    """Two non-blocking descriptors (or one, twice)."""

    def __init__(
        self, reader: int, writer: int, timeout: float, fate: Callable[[], str], release: Callable[[], None]
    ) -> None:
        """Take over the descriptors.

        Parameters
        ----------
        timeout
            s; how long a write waits on a full line
        fate
            says in one sentence why the far end has gone
        release
            closes the descriptors and ends what drives the far end; called once
        """
        self._reader = reader
        self._writer = writer
        self._timeout = timeout
        self._fate = fate
        self._release: Callable[[], None] | None = release
        self._readable = select.poll()
        self._readable.register(reader, select.POLLIN)
        self._writable = select.poll()
        self._writable.register(writer, select.POLLOUT)

    def write(self, data: bytes) -> None:
        """Send all of `data`."""
        try:
            sent = os.write(self._writer, data)
        except BlockingIOError:
            sent = 0
        except OSError:
            raise LinkError(self._fate()) from None
        if sent < len(data):
            self._write_rest(data[sent:])

    def _write_rest(self, data: bytes) -> None:
        deadline = time.monotonic() + self._timeout
        while data:
            left = deadline - time.monotonic()
            if left <= 0 or not self._writable.poll(left * 1000):
                raise LinkError(f"{self._fate()} (it took no bytes for {self._timeout:g} s)")
            try:
                data = data[os.write(self._writer, data) :]
            except BlockingIOError:
                continue
            except OSError:
                raise LinkError(self._fate()) from None

    def read(self, timeout: float) -> bytes:
        """Return the bytes that are there, or come within `timeout` seconds; none if none came."""
        if not self._readable.poll(timeout * 1000):
            return b""
        try:
            data = os.read(self._reader, CHUNK)
        except BlockingIOError:
            return b""
        except OSError:
            raise LinkError(self._fate()) from None
        if not data:
            raise LinkError(self._fate())
        return data

    def close(self) -> None:
        """Release everything; a second call does nothing."""
        release, self._release = self._release, None
        if release is not None:
            self._reader = self._writer = -1
            release()


class PipeStream(DescriptorStream):
    """Two pipes of a far end that nearly always answers at once: reads block, and an alarm ends those that take long.

    To ask first whether bytes are there would cost a tenth of a whole exchange. The alarm writes a zero byte into our
    own input, which between frames means nothing. It also has the far end wait for us when we ask for nothing, however
    the two take turns.
    """

    def __init__(
        self,
        reader: int,
        writer: int,
        timeout: float,
        opening: float,
        fate: Callable[[], str],
        release: Callable[[], None],
        way: PipeTurns,
    ) -> None:
        """Take over the descriptors, as DescriptorStream does; `opening` s are given to the first bytes to come."""
        super().__init__(reader, writer, timeout, fate, release)
        self._patience = opening
        self._way = way
        self._turns = Turns(way, time.monotonic())
        self._exchange: Exchange | None = None
        with suppress(ToolError):  # without a compiler it is slower, and that is all
            self._exchange = Exchange(reader, writer)
        self._due = math.inf  # when the alarm goes off, by time.monotonic()
        self._closed = threading.Event()
        self._alarm = threading.Thread(target=self._watch, name="firmloop alarm", daemon=True)
        self._alarm.start()

    def read(self, timeout: float) -> bytes:
        """Return the bytes that are there or come within `timeout` seconds and some; a zero byte if none came."""
        self._due = time.monotonic() + max(timeout, self._patience)
        try:
            data = self._read_waiting()
        except OSError:
            raise LinkError(self._fate()) from None
        self._due, self._patience = math.inf, 0.0
        if not data:
            raise LinkError(self._fate())
        return data

    def exchange(
        self, kind: int, sequence: int, bound: int, payload: bytes, timeout: float
    ) -> tuple[bytes | None, bytes | None]:
        """Send one request and read its reply at once, as verify.links.exchange says; (None, None) if it cannot."""
        if self._exchange is None:
            return None, None
        now = time.monotonic()
        self._turns.count(now)
        self._due = now + timeout
        found = self._exchange(kind, sequence, bound, payload)
        self._due = math.inf
        return found

    def close(self) -> None:
        """Release everything; a second call does nothing."""
        self._exchange = None
        self._closed.set()
        if self._alarm is not threading.current_thread():
            self._alarm.join()
        super().close()

    def _read_waiting(self) -> bytes:
        while True:
            try:
                return os.read(self._reader, CHUNK)
            except BlockingIOError:  # we were asking
                self._readable.poll()

    def _watch(self) -> None:
        left = self._turns.left
        while not self._closed.wait(ALARM_PERIOD):
            if self._turns.asking and self._turns.left == left:
                self._way.set_emulator_blocking(True)
            left = self._turns.left
            if time.monotonic() > self._due:
                with suppress(OSError), open(f"/proc/self/fd/{self._reader}", "wb", buffering=0) as pipe:
                    pipe.write(b"\0")


class PortStream:
    """A pyserial port without a descriptor, such as rfc2217://; slower, for pyserial has to be asked twice."""

    def __init__(self, port: serial.SerialBase, fate: Callable[[], str], release: Callable[[], None]) -> None:
        self._port = port
        self._fate = fate
        self._release: Callable[[], None] | None = release

    def write(self, data: bytes) -> None:
        """Send all of `data`."""
        try:
            self._port.write(data)
        except (serial.SerialException, OSError):
            raise LinkError(self._fate()) from None

    def read(self, timeout: float) -> bytes:
        """Return the bytes that are there, or come within `timeout` seconds; none if none came."""
        try:
            if self._port.timeout != timeout:
                self._port.timeout = timeout
            first: bytes = self._port.read(1)
            return first + self._port.read(self._port.in_waiting) if first else b""
        except (serial.SerialException, OSError):
            raise LinkError(self._fate()) from None

    def close(self) -> None:
        """Release everything; a second call does nothing."""
        release, self._release = self._release, None
        if release is not None:
            release()


def open_serial(
    url: str, baud: int, timeout: float, fate: Callable[[], str], release: Callable[[], None]
) -> DescriptorStream | PortStream:
    """Open a device, a pseudo-terminal's path or any URL of pyserial; `release` is called after the port is closed."""
    try:
        port = serial.serial_for_url(url, baudrate=baud, timeout=timeout, write_timeout=timeout)
    except (serial.SerialException, OSError, ValueError) as error:
        raise LinkError(f"{fate()} (it cannot be opened: {error})") from None

    def let_go() -> None:
        try:
            # pyserial drops a socket unclosed if its far end has gone; dropping closes it, but with a warning.
            with warnings.catch_warnings(action="ignore", category=ResourceWarning):
                port.close()
        finally:
            release()

    try:
        if not hasattr(select, "poll"):
            return PortStream(port, fate, let_go)
        descriptor = port.fileno()
    except (AttributeError, io.UnsupportedOperation):
        return PortStream(port, fate, let_go)
    return DescriptorStream(descriptor, descriptor, timeout, fate, let_go)

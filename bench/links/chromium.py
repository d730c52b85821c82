"""Drive a headless Chromium over its pipe: load a page, ask it, point at it, and tell what it costs."""

from __future__ import annotations

import itertools
import json
import os
import shutil
import subprocess
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

NAMES = ("chromium", "chromium-browser", "google-chrome")
START = 60.0  # s
ANSWER = 60.0  # s


def chromium() -> str | None:
    """Return the path of a browser of this machine."""
    return next((path for name in NAMES if (path := shutil.which(name))), None)


class Browser:
    """One page, asked by the DevTools protocol: JSON messages with a zero byte behind each."""

    def __init__(self, reader: int, writer: int) -> None:
        self._reader, self._writer = reader, writer
        self._pending = b""
        self._numbers = itertools.count(1)
        self._session: str | None = None
        self.complaints: list[str] = []
        target = self._call("Target.createTarget", url="about:blank")["targetId"]
        self._session = self._call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        self._call("Runtime.enable")
        self._call("Page.enable")

    def open(self, url: str, width: int = 1200, height: int = 900) -> None:
        """Load a page in a window of that size."""
        self._call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)
        self._call("Page.navigate", url=url)
        self.wait("document.readyState === 'complete'")

    def colours(self, scheme: str) -> None:
        """Ask pages for their colours by day, `light`, or by night, `dark`."""
        self._call("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])

    def ask(self, expression: str) -> object:
        """Return what an expression of the page is."""
        told = self._call("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in told, told["exceptionDetails"]
        return told["result"].get("value")

    def wait(self, expression: str, seconds: float = ANSWER) -> None:
        """Wait until an expression of the page holds."""
        deadline = time.monotonic() + seconds
        while not self.ask(expression):
            assert time.monotonic() < deadline, f"never so: {expression}"
            time.sleep(0.1)

    def point(self, x: float, y: float, *, click: bool = False, shift: bool = False) -> None:
        """Move the pointer, and click."""
        held = 8 if shift else 0
        self._call("Input.dispatchMouseEvent", type="mouseMoved", x=x, y=y, modifiers=held)
        for kind in ("mousePressed", "mouseReleased") if click else ():
            self._call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1, modifiers=held)

    def picture(self) -> str:
        """Return a PNG of the window, in base64."""
        return str(self._call("Page.captureScreenshot", format="png")["data"])

    def seconds(self) -> float:
        """Return how long processors have worked for all of the browser's processes."""
        session, self._session = self._session, None
        told = self._call("SystemInfo.getProcessInfo")
        self._session = session
        return float(sum(process["cpuTime"] for process in told["processInfo"]))

    def _call(self, method: str, **parameters: object) -> dict:
        number = next(self._numbers)
        message = {"id": number, "method": method, "params": parameters}
        if self._session is not None:
            message["sessionId"] = self._session
        os.write(self._writer, json.dumps(message).encode() + b"\0")
        while True:
            told = self._next()
            if told.get("method") == "Runtime.exceptionThrown":
                self.complaints.append(str(told["params"]["exceptionDetails"]))
            if told.get("id") == number:
                assert "error" not in told, f"{method}: {told['error']}"
                return dict(told["result"])

    def _next(self) -> dict:
        while b"\0" not in self._pending:
            data = os.read(self._reader, 1 << 16)
            assert data, "the browser has ended"
            self._pending += data
        text, _, self._pending = self._pending.partition(b"\0")
        return dict(json.loads(text))


@contextmanager
def browsing() -> Iterator[Browser]:
    """Give a browser, which ends with the block."""
    path = chromium()
    assert path is not None, "ask chromium() first"
    theirs_in, ours_out = os.pipe()
    ours_in, theirs_out = os.pipe()
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        # It reads from descriptor 3 and writes to 4; a shell puts them there, and becomes the browser.
        command = f'exec "$0" "$@" 3<&{theirs_in} 4>&{theirs_out}'
        options = (
            *("--headless", "--no-sandbox", "--disable-gpu", "--remote-debugging-pipe", "--no-first-run"),
            *("--disable-background-networking", "--disable-extensions", f"--user-data-dir={Path(folder) / 'user'}"),
        )
        process = subprocess.Popen(
            ["/bin/bash", "-c", command, path, *options],
            pass_fds=(theirs_in, theirs_out),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        os.close(theirs_in)
        os.close(theirs_out)
        try:
            yield Browser(ours_in, ours_out)
        finally:
            with suppress(OSError):
                os.close(ours_out)
            try:
                process.wait(5.0)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
            os.close(ours_in)

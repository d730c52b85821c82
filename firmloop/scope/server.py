"""Serve the page of the scope to this machine alone: the page, its samples as server-sent events, settings by POST.

Every address begins with a token that only who was told the URL knows; requests that come from a page of another
origin, or under another name than this machine's, are refused.
"""

from __future__ import annotations

import base64
import json
import math
import secrets
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from urllib.parse import parse_qs, urlsplit

from firmloop.console import complain, json_of
from firmloop.identify.recordings.recording import write_recording
from firmloop.project.table import ProjectError
from firmloop.scope.display import Display
from firmloop.scope.page import page_of
from firmloop.verify.link import LinkError

HOST = "127.0.0.1"
NAMES = (HOST, "localhost")  # under which this machine may be asked; another is another site's that points here
BEAT = 0.05  # s between two events; more would cost the browser time and show nobody more
SILENCE = 1.0  # s without a sample after which an empty event finds out whether somebody still reads
MOST_ROWS = 5_000  # in one event
MOST_BODY = 1_000  # bytes of a setting
PARTING = 2.0  # s for the pages to hear how it ended


class ScopeServer(ThreadingHTTPServer):
    """A server whose answers run beside the watch, and never keep it from ending."""

    daemon_threads = True

    def __init__(self, display: Display, port: int) -> None:
        self.display = display
        self.token = secrets.token_urlsafe(16)
        self.ending = ""  # how the watch ended
        self.over = threading.Event()  # it has ended, and `ending` says how
        self.readers: set[_Answer] = set()
        super().__init__((HOST, port), _Answer)

    @property
    def url(self) -> str:
        """Where the page is."""
        return f"http://{HOST}:{self.server_port}/{self.token}/"

    def handle_error(self, request: object, client_address: object) -> None:
        """Say nothing of a browser that closes: the watch goes on, as it does after a fault of ours."""
        error = sys.exception()
        if not isinstance(error, ConnectionError):
            complain(f"internal error of the page: {type(error).__name__}: {error}; please report it")


class _Answer(BaseHTTPRequestHandler):
    server: ScopeServer
    server_version, sys_version = "firmloop", ""

    def do_GET(self) -> None:
        """Send the page, its samples, or a recording of some rows."""
        place = self._place()
        if place == "":
            self._send_page()
        elif place == "events":
            self._send_events()
        elif place == "recording.csv":
            self._send_recording()
        elif place is not None:
            self._refuse(HTTPStatus.NOT_FOUND, f"{place}: is nothing of this page")

    def do_POST(self) -> None:
        """Set a parameter."""
        place = self._place()
        if place is None:
            return
        if place != "set":
            self._refuse(HTTPStatus.NOT_FOUND, f"{place}: is nothing of this page")
            return
        try:
            name, value = self._asked()
            done = self.server.display.set(name, value)
        except ProjectError as error:
            self._refuse(HTTPStatus.BAD_REQUEST, str(error))
        except LinkError as error:
            self._refuse(HTTPStatus.SERVICE_UNAVAILABLE, str(error))
        else:
            self._send(HTTPStatus.OK, "application/json", json_of(done).encode())

    def log_message(self, *unused: object) -> None:
        """Log nothing: the terminal is the user's."""

    def _place(self) -> str | None:
        """Return what is asked for, behind the token; None after a refusal."""
        host = self.headers.get("Host", "")
        own = host.partition(":")[0] in NAMES and self.headers.get("Origin") in (None, f"http://{host}")
        token, _, place = urlsplit(self.path).path.removeprefix("/").partition("/")
        if not own or self.headers.get("Sec-Fetch-Site", "none") not in ("same-origin", "none"):
            self._refuse(HTTPStatus.FORBIDDEN, "this page answers to itself alone, on this machine")
        elif not secrets.compare_digest(token.encode(), self.server.token.encode()):
            self._refuse(HTTPStatus.FORBIDDEN, "the token is missing or of an older run: use the URL of the terminal")
        else:
            return place
        return None

    def _send_page(self) -> None:
        display = self.server.display
        page = page_of({**display.facts(), "rows": len(display.tape), "now": display.now()})
        self._send(HTTPStatus.OK, "text/html; charset=utf-8", page.text.encode(), page.policy)

    def _send_events(self) -> None:
        """Send rows for as long as they come; a page that was cut off goes on where it was."""
        display = self.server.display
        begin = self._number("begin", self.headers.get("Last-Event-ID") or "")
        self._head(HTTPStatus.OK, "text/event-stream", None)
        self.server.readers.add(self)
        try:
            for rows in display.tape.follow(begin, MOST_ROWS, SILENCE):
                told = {
                    "begin": begin,
                    "missing": display.tape.missing,
                    "now": display.now(),
                    "rows": base64.b64encode(display.values(rows).astype("<f8").tobytes()).decode(),
                }
                begin += len(rows)
                self._event("rows", told, begin)
                if len(rows) < MOST_ROWS:
                    time.sleep(BEAT)
            self.server.over.wait()
            self._event("over", {"says": self.server.ending}, begin)
        finally:
            self.server.readers.discard(self)

    def _event(self, kind: str, told: object, number: int) -> None:
        self.wfile.write(f"event: {kind}\nid: {number}\ndata: {json_of(told)}\n\n".encode())

    def _send_recording(self) -> None:
        try:
            recording = self.server.display.recording(self._number("begin", ""), self._number("end", ""))
        except ProjectError as error:
            self._refuse(HTTPStatus.BAD_REQUEST, str(error))
            return
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "view.csv"
            write_recording(recording, file)
            self._send(HTTPStatus.OK, "text/csv; charset=utf-8", file.read_bytes())

    def _number(self, key: str, first: str) -> int:
        text = first or parse_qs(urlsplit(self.path).query).get(key, ["0"])[0]
        return int(text) if text.isascii() and text.isdigit() and len(text) < 12 else 0

    def _asked(self) -> tuple[str, float]:
        """Read {"name": ..., "value": ...}."""
        length = self.headers.get("Content-Length", "")
        try:
            body = self.rfile.read(int(length)) if length.isdigit() and int(length) <= MOST_BODY else b""
            told = json.loads(body)
            name, value = str(told["name"]), float(told["value"])
        except (ValueError, KeyError, TypeError, OverflowError):
            raise ProjectError('a setting is {"name": "kp", "value": 1.2}') from None
        if not math.isfinite(value):
            raise ProjectError(f"{name}={value}: is no number that can be set")
        return name, value

    def _refuse(self, status: HTTPStatus, says: str) -> None:
        self._send(status, "application/json", json_of({"error": says}).encode())

    def _send(self, status: HTTPStatus, kind: str, content: bytes, policy: str = "default-src 'none'") -> None:
        self._head(status, kind, len(content), policy)
        self.wfile.write(content)

    def _head(self, status: HTTPStatus, kind: str, length: int | None, policy: str = "default-src 'none'") -> None:
        self.send_response(status)
        self.send_header("Content-Type", kind)
        if length is not None:
            self.send_header("Content-Length", str(length))
        for name, value in (
            ("Content-Security-Policy", policy),
            ("Cache-Control", "no-store"),
            ("X-Content-Type-Options", "nosniff"),
            ("Referrer-Policy", "no-referrer"),
            ("Cross-Origin-Resource-Policy", "same-origin"),
        ):
            self.send_header(name, value)
        self.end_headers()


@contextmanager
def served(display: Display, port: int) -> Iterator[ScopeServer]:
    """Serve a display on a port of this machine, any free one if 0, until its watch has ended and the pages know it.

    Raises
    ------
    ProjectError
        when the port is taken.
    """
    try:
        server = ScopeServer(display, port)
    except OSError as error:
        raise ProjectError(
            f"--page-port {port}: cannot be used: {error.strerror}; leave it out to take any free one"
        ) from None
    thread = threading.Thread(target=server.serve_forever, name="firmloop scope", daemon=True)
    thread.start()
    try:
        yield server
    finally:
        server.over.set()
        deadline = time.monotonic() + PARTING
        while server.readers and time.monotonic() < deadline:
            time.sleep(BEAT)
        server.shutdown()
        server.server_close()

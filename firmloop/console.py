"""The only printer: results on stdout, progress and complaints on stderr."""

from __future__ import annotations

import json
import os
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from typing import Protocol

QUIET = 2.0  # s; what is done sooner needs no bar
REDRAW = 0.2  # s between two drawings of a bar
PLAIN = 5.0  # s between two lines where stderr is no terminal
WIDTH = 24  # characters of a bar
USUAL_COLUMNS = 80

Picture = Callable[[], Iterable[str]]


class Console(Protocol):
    """What a verb may tell the user."""

    def lines(self, lines: Iterable[str]) -> None:
        """Show a result as text."""

    def result(self, key: str, value: object) -> None:
        """Keep a result for the JSON document."""

    def close(self) -> None:
        """Show what was kept."""

    def fail(self, message: str) -> None:
        """Say why there is no result."""


class NoRoomError(Exception):
    """Standard output takes no more: of a place that is none of the project's, it is no `OSError`."""


class TextConsole:
    """Results for people."""

    def lines(self, lines: Iterable[str]) -> None:
        """Print at once, so that a long walk shows where it is."""
        _show("".join(f"{visible(line)}\n" for line in lines))

    def result(self, key: str, value: object) -> None:
        """Keep nothing: the lines have said it."""

    def close(self) -> None:
        """Show nothing more."""

    def fail(self, message: str) -> None:
        """Say it on stderr."""
        complain(message)


class JsonConsole:
    """Results for machines: one document on stdout and nothing else."""

    def __init__(self) -> None:
        self._document: dict[str, object] = {"schema": 1}

    def lines(self, lines: Iterable[str]) -> None:
        """Print nothing: the document will say it."""

    def result(self, key: str, value: object) -> None:
        """Keep one part of the document."""
        self._document[key] = value

    def close(self) -> None:
        """Print the document."""
        _show(f"{json_of(self._document, 1)}\n")

    def fail(self, message: str) -> None:
        """Say it on stderr, and in a document that holds nothing else."""
        complain(message)
        self._document = {"schema": 1, "error": message}
        self.close()


class Progress:
    """How far a piece of work is; call it with the share done (0 to 1) and what is being done, as often as you like.

    `picture` gives lines that are drawn below it on a terminal, each time anew.
    """

    def __init__(self, label: str, picture: Picture) -> None:
        self._label = visible(label)
        self._picture = picture
        self._share: float | None = None
        self._doing = ""
        self._begun = time.monotonic()
        self._shown = 0.0
        self._drawn = False
        self._done = threading.Event()
        self._terminal = sys.stderr.isatty()
        self._drawer = threading.Thread(target=self._watch, daemon=True)

    def __call__(self, share: float, doing: str) -> None:
        """Note the share done; the drawing is done elsewhere, at its own pace."""
        self._share = min(max(share, 0.0), 1.0)
        self._doing = visible(doing)

    def start(self) -> None:
        """Draw from a thread of its own from now on, because the work may never call."""
        self._drawer.start()

    def finish(self) -> None:
        """Take the bar away, after the last of it was drawn."""
        self._done.set()
        self._drawer.join()
        if self._drawn:
            _error("\r\x1b[J")

    def _watch(self) -> None:
        while not self._done.wait(REDRAW):
            now = time.monotonic()
            if now - self._begun < QUIET or (not self._terminal and now - self._shown < PLAIN):
                continue
            self._shown = now
            self._draw(now - self._begun)

    def _draw(self, elapsed: float) -> None:
        share = "" if self._share is None else f" {self._share:4.0%} {self._doing}".rstrip()
        if not self._terminal:
            _error(f"{self._label}:{share} after {elapsed:.0f} s\n")
            return
        self._drawn = True
        full = 0 if self._share is None else round(self._share * WIDTH)
        bar = "" if self._share is None else f" [{'#' * full}{'.' * (WIDTH - full)}]"
        below = [visible(line)[: _columns() - 1] for line in self._picture()]  # one that wraps is not drawn over
        drawn = "".join(f"\n\x1b[K{line}" for line in below)
        back = f"\x1b[{len(below)}A" if below else ""
        _error(f"\r\x1b[K{self._label}{bar}{share} {elapsed:.0f} s{drawn}{back}\r")


@contextmanager
def progress(label: str, picture: Picture = tuple) -> Iterator[Progress]:
    """Show on stderr that something is being done, if it lasts longer than two seconds."""
    bar = Progress(label, picture)
    bar.start()
    try:
        yield bar
    finally:
        bar.finish()


def announce(message: str) -> None:
    """Say on stderr what a person needs to know while it is being done."""
    _error(f"{visible(message)}\n")


def complain(message: str) -> None:
    """Say on stderr what is wrong."""
    _error(f"firmloop: {visible(message)}\n")


def visible(text: str) -> str:
    r"""Write what a terminal would obey or hide as an escape: of a stranger's file, it sees plain characters only.

    Control characters, marks of writing direction, and separators of lines and paragraphs are meant; a newline stays.

    >>> visible("gain\x1b[2J \u202e")
    'gain\\x1b[2J \\u202e'
    """
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() or c in "\n\t" else c.encode("unicode_escape").decode() for c in text)


def table(rows: Iterable[tuple[str, ...]]) -> list[str]:
    """Align rows of words into lines: two spaces in front, columns as wide as their longest word."""
    kept = list(rows)
    widths = [
        max(len(row[column]) for row in kept if column < len(row)) for column in range(max(map(len, kept), default=0))
    ]
    lines = []
    for row in kept:
        words = [word.ljust(width) for word, width in zip(row, widths, strict=False)]
        lines.append(f"  {'  '.join(words)}".rstrip())
    return lines


def json_of(document: object, indent: int | None = None) -> str:
    """Return a document in JSON, in ASCII so that no control character leaves it raw.

    A number that is no figure, NaN or infinite, is null: JSON has no word for it, and who reads it would stop there.
    """
    told = json.loads(json.dumps(document, default=_plain), parse_constant=lambda _: None)
    return json.dumps(told, indent=indent, allow_nan=False)


def open_streams() -> None:
    """Let standard output and errors that whoever called has closed swallow what is said."""
    if sys.stdout is None:
        sys.stdout = open(os.devnull, "w", encoding="utf-8")
    if sys.stderr is None:
        sys.stderr = open(os.devnull, "w", encoding="utf-8")


def forget_output() -> None:
    """Let nothing more be said: Python flushes standard output once more when it ends."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _show(text: str) -> None:
    try:
        sys.stdout.write(text)
        sys.stdout.flush()
    except BrokenPipeError:
        raise
    except OSError as error:
        raise NoRoomError(f"standard output cannot be written: {error.strerror}; send it elsewhere") from None


def _error(text: str) -> None:
    """Write to stderr; a reader that went away must not stop the work."""
    try:
        sys.stderr.write(text)
        sys.stderr.flush()
    except (OSError, ValueError):
        pass


def _columns() -> int:
    """Return how wide the terminal of stderr is."""
    try:
        return os.get_terminal_size(sys.stderr.fileno()).columns or USUAL_COLUMNS
    except (OSError, ValueError):
        return USUAL_COLUMNS


def _plain(value: object) -> object:
    """Turn what JSON does not know, numpy's numbers and frozen mappings, into what it does."""
    if isinstance(value, Mapping):
        return dict(value)
    return value.item() if hasattr(value, "item") else str(value)

"""Read one TOML table strictly: every complaint names file, line, table, key, value, rule and way out."""

from __future__ import annotations

import difflib
import math
import re
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TypeGuard

from firmloop.identify.regular_file import MOST_TEXT, read_regular
from firmloop.project.extent import faults
from firmloop.project.toml_lines import key_lines

ALMOST = 0.8  # likeness of one letter too few in a word of four: knd is kind, and kd is not


class ProjectError(Exception):
    """The user's project file or command is wrong; the message is one line and says where, what and the way out."""


@dataclass(frozen=True, slots=True)
class ProjectTable:
    """One table of a TOML file: its place in the file, its values, and the line of every key."""

    file: Path
    place: tuple[str, ...]
    values: Mapping[str, object]
    lines: Mapping[tuple[str, ...], int]

    def wrong(self, key: str, rule: str) -> ProjectError:
        """Return the error that `key` of this table breaks `rule`; the value is shown if there is one."""
        shown = f" = {_shown(self.values[key])}" if key in self.values else ""
        return self.remark(key, f"{key}{shown}: {rule}")

    def complaint(self, message: str) -> ProjectError:
        """Return another package's complaint, with the line of the dotted key it begins with (`controller.kp`)."""
        place, _, rest = message.partition(" ")
        key = self._of_a_list(tuple(place.rstrip(":").split(".")), rest)
        held = next((key[:length] for length in range(len(key), 0, -1) if key[:length] in self.lines), None)
        line = f":{self.lines[held]}" if held else ""
        return ProjectError(f"{self.file}{line}: {message}")

    def _of_a_list(self, key: tuple[str, ...], rest: str) -> tuple[str, ...]:
        """Find in a list of tables the one whose name a complaint about the list goes on with, `name` or `name.key`.

        Of several it is one that has that key, or lacks it where it is said to be missing; and has the value told.
        """
        entries: object = self.values
        for name in key:
            entries = entries.get(name) if isinstance(entries, Mapping) else None
        if not isinstance(entries, list):
            return key
        name, _, inner = rest.partition(" ")[0].strip("':").partition(".")
        named = [k for k, one in enumerate(entries) if isinstance(one, Mapping) and one.get("name") == name]
        lacks = " is missing" in rest
        meant = [k for k in named if (inner in entries[k]) is not lacks] or named[-1:]
        told = {k: _told(entries[k].get(inner)) for k in meant}
        meant.sort(key=lambda k: rest.index(told[k]) if told[k] in rest else len(rest))
        return (*key, str(meant[0]), inner or "name") if meant else key

    def remark(self, key: str, message: str) -> ProjectError:
        """Return `message` as an error at the line of `key`."""
        return ProjectError(f"{self._where(key)}{self._title()}{message}")

    def only(self, known: Iterable[str]) -> None:
        """Refuse every key that is not in `known`, naming the nearest one."""
        names = sorted(known)
        for key in self.values:
            if key in names:
                continue
            near = difflib.get_close_matches(key.lower(), names, n=1, cutoff=0.6)
            hint = f"did you mean '{near[0]}'?" if near else f"known here: {', '.join(names)}"
            raise self.remark(key, f"unknown key {_shown(key)}; {hint}")

    def missing(self, key: str, example: str) -> ProjectError:
        """Return the error that `key` is not there, with a line that would mend it, or the key that it may be."""
        near = difflib.get_close_matches(key, self.values, n=1, cutoff=ALMOST)
        if near and near[0] != key:
            return self.remark(near[0], f"'{key}' is missing; did you write '{near[0]}' for it?")
        return self.remark("", f"'{key}' is missing; write for instance: {example}")

    def text(self, key: str, example: str) -> str:
        """Return a text that must be there."""
        if key not in self.values:
            raise self.missing(key, example)
        value = self.values[key]
        if not isinstance(value, str) or not value:
            raise self.wrong(key, f"must be a text, such as {example}")
        return value

    def number(self, key: str, example: str) -> float:
        """Return a finite number that must be there."""
        if key not in self.values:
            raise self.missing(key, example)
        value = self.values[key]
        if not _is_finite(value):
            raise self.wrong(key, f"must be a finite number, such as {example}")
        return float(value)

    def texts(self, key: str, example: str) -> tuple[str, ...]:
        """Return a list of different texts; empty where the key is not there."""
        value = self.values.get(key, [])
        if not isinstance(value, list) or not all(isinstance(item, str) and item for item in value):
            raise self.wrong(key, f"must be a list of texts, such as {example}")
        if len(set(value)) != len(value):
            raise self.wrong(key, "names the same thing twice")
        return tuple(value)

    def texts_differ(self) -> None:
        """Refuse two keys with the same value."""
        seen: dict[object, str] = {}
        for key, value in self.values.items():
            if value in seen:
                raise self.wrong(key, f"is already the value of '{seen[value]}'")
            seen[value] = key

    def table(self, key: str) -> ProjectTable:
        """Return the table under `key`; an empty one where there is none."""
        value = self.values.get(key, {})
        if not isinstance(value, dict):
            raise self.wrong(key, f"must be a table: [{'.'.join((*self.place, key))}]")
        return ProjectTable(self.file, (*self.place, key), value, self.lines)

    def without(self, *keys: str) -> Mapping[str, object]:
        """Return the values whose keys are not among `keys`, in file order."""
        return {key: value for key, value in self.values.items() if key not in keys}

    def _where(self, key: str) -> str:
        line = self.lines.get((*self.place, key)) or self.lines.get(self.place)
        return f"{self.file}:{line}: " if line else f"{self.file}: "

    def _title(self) -> str:
        return f"[{'.'.join(self.place)}] " if self.place else ""


def read_table(file: Path) -> ProjectTable:
    """Read a whole TOML file.

    Raises
    ------
    ProjectError
        when it cannot be read, is empty, is not UTF-8 or is not TOML.
    """
    try:
        raw = read_regular(file, MOST_TEXT)
    except FileNotFoundError:
        raise ProjectError(f"{file}: no such file; name the project's TOML file") from None
    except IsADirectoryError:
        raise ProjectError(f"{file}: is a folder; name the project's TOML file in it") from None
    except OSError as error:
        raise ProjectError(f"{file}: cannot be read: {error.strerror}") from None
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = raw.count(b"\n", 0, error.start) + 1
        raise ProjectError(f"{file}:{line}: is not UTF-8 text (byte {error.start}); save it as UTF-8") from None
    if not text.strip():
        raise ProjectError(f"{file}: is empty; a project begins with: schema = 1")
    try:
        values = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ProjectError(_toml_complaint(file, text, str(error))) from None
    except (RecursionError, ValueError):
        raise ProjectError(f"{file}: holds brackets nested too deep or a number too long to be a project") from None
    lines = key_lines(text)
    for place, rule in faults(values, ()):
        *above, key = place or ("",)
        raise ProjectTable(file, tuple(above), {}, lines).remark(key, f"{key or 'the file'} {rule}")
    return ProjectTable(file, (), values, lines)


def _toml_complaint(file: Path, text: str, message: str) -> str:
    """Turn tomllib's words into ours: line in front, no column arithmetic for the reader."""
    reason, _, place = message.partition(" (at ")
    number = place.removeprefix("line ").split(",")[0]
    line = int(number) if number.isdigit() else text.rstrip().count("\n") + 1
    shown = text.split("\n")[line - 1].strip()[:60]
    return f"{file}:{line}: is not valid TOML: {reason[:1].lower()}{reason[1:]}, at: {_shown(shown)}{_as_toml(shown)}"


_TEXT = re.compile(r"\"[^\"]*\"|'[^']*'|#.*")
_BARE_POINT = re.compile(r"(?<![\w.])([-+]?)(?:(\d+)\.|\.(\d+))((?:[eE][-+]?\d+)?)(?![\w.])")  # .02 or 5.
_COMMA = re.compile(r"=\s*([-+]?\d+),(\d+)\s*$")
_NO_EQUALS = re.compile(r"[\w.-]+\s*(?::=?|\s)\s*[-+.\w]")


def _as_toml(line: str) -> str:
    """Say how TOML writes a line that is written as in other languages; empty where it is not."""
    bare = _TEXT.sub("", line)
    if _NO_EQUALS.match(bare):
        return "; write = between a key and its value"
    if comma := _COMMA.search(bare):
        return f"; write {comma[1]}.{comma[2]}, or several numbers in brackets"
    if point := _BARE_POINT.search(bare):
        sign, before, behind, power = point.groups()
        return f"; write {sign}{before or 0}.{behind or 0}{power}, with a digit before and behind the point"
    return ""


def _is_finite(value: object) -> TypeGuard[int | float]:
    """Tell whether a TOML value is a number that a double can hold."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    try:
        return math.isfinite(float(value))
    except OverflowError:
        return False


def _told(value: object) -> str:
    """Return a value, with or without an interval, as another package tells it."""
    inner = value.get("value") if isinstance(value, Mapping) else value
    return f"{inner:g}" if isinstance(inner, int | float) else str(inner)


def _shown(value: object) -> str:
    """Return a value as it may stand in a one-line message: short and printable."""
    if isinstance(value, bool):
        return str(value).lower()
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."

"""Read one TOML table key by key, so that a missing, a wrong and an unknown key each get their own sentence."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from firmloop.codegen.bundle import CodegenError
from firmloop.codegen.toolchain import FLAG_RULE, is_flag

PLACE = r"(?!(?:.*/)?\.\.(?:/|$))[A-Za-z0-9_][A-Za-z0-9_./-]*"


class TomlTable:
    """The keys of one table; each is checked as it is read, and `finish` refuses those that nobody read."""

    def __init__(self, values: Mapping[str, Any], file: str, path: str) -> None:
        self._values = values
        self._file = file
        self._path = path  # dotted, with a trailing dot; empty for the root
        self._known: list[str] = []

    def wrong(self, key: str, value: object, rule: str) -> CodegenError:
        """Return the error that names the file, the key, the value and the rule it breaks."""
        return CodegenError(f"{self._file}: {self._path}{key} = {value!r}: {rule}")

    def has(self, key: str) -> bool:
        """Say whether an optional key is there."""
        self._known.append(key)
        return key in self._values

    def integer(self, key: str, low: int, high: int) -> int:
        """Return a whole number from `low` to `high`."""
        value = self._value(key)
        if not isinstance(value, int) or isinstance(value, bool) or not low <= value <= high:
            raise self.wrong(key, value, f"must be a whole number from {low} to {high}")
        return value

    def word(self, key: str) -> str:
        """Return a text that may stand in a file name or a command."""
        return self._text(key, r"[A-Za-z][A-Za-z0-9_.-]*", "must be letters, digits, '_', '-' or '.'")

    def identifier(self, key: str) -> str:
        """Return a text that may stand in a linker script, where '-' and '.' mean something else."""
        return self._text(key, r"[A-Za-z][A-Za-z0-9_]{0,30}", "must be letters, digits or '_', at most 31")

    def places(self, key: str) -> tuple[str, ...]:
        """Return a list of names of files that come with a tool, none of them outside its folder."""
        return self._texts(key, PLACE, "is not a file's name of letters, digits, '_', '-', '.' and '/', without '..'")

    def usb_ids(self, key: str) -> tuple[str, ...]:
        """Return a list of USB vendor and product numbers."""
        return self._texts(key, r"[0-9a-f]{4}:[0-9a-f]{4}", "is not vendor:product in small hex digits, as '0483:374b'")

    def phrase(self, key: str) -> str:
        """Return a text that may stand in a comment."""
        return self._text(
            key, r"(?!.*\*/)[ -~]{1,100}", "must be a line of ASCII, at most 100 characters, without '*/'"
        )

    def choice(self, key: str, known: Sequence[str]) -> str:
        """Return one of the known words."""
        value = self._value(key)
        if value not in known:
            raise self.wrong(key, value, f"is unknown; known: {', '.join(known)}")
        return str(value)

    def choices(self, key: str, known: Sequence[str]) -> tuple[str, ...]:
        """Return a list of known words, each at most once."""
        value = self._value(key)
        if not isinstance(value, list):
            raise self.wrong(key, value, f"must be a list of {', '.join(known)}")
        for entry in value:
            if entry not in known:
                raise self.wrong(key, entry, f"is unknown; known: {', '.join(known)}")
        if len(set(value)) != len(value):
            raise self.wrong(key, value, "names something twice")
        return tuple(value)

    def compiler_flags(self, key: str) -> tuple[str, ...]:
        """Return flags for a compiler's command line."""
        return self._accepted(key, is_flag, FLAG_RULE)

    def table(self, key: str) -> TomlTable:
        """Return a table within this one."""
        value = self._value(key)
        if not isinstance(value, dict):
            raise self.wrong(key, value, "must be a table")
        return TomlTable(value, self._file, f"{self._path}{key}.")

    def tables(self, key: str) -> tuple[TomlTable, ...]:
        """Return a list of tables within this one."""
        value = self._value(key)
        if not isinstance(value, list) or not all(isinstance(entry, dict) for entry in value):
            raise self.wrong(key, value, f"must be a list of tables, written [[{key}]]")
        return tuple(
            TomlTable(entry, self._file, f"{self._path}{key}[{number}].") for number, entry in enumerate(value, 1)
        )

    def finish(self) -> None:
        """Refuse the keys that nobody read."""
        for key in self._values:
            if key not in self._known:
                raise self.wrong(key, self._values[key], f"is an unknown key; known: {', '.join(self._known)}")

    def _value(self, key: str) -> Any:
        self._known.append(key)
        if key not in self._values:
            raise CodegenError(f"{self._file}: {self._path}{key} is missing")
        return self._values[key]

    def _texts(self, key: str, pattern: str, rule: str) -> tuple[str, ...]:
        return self._accepted(key, lambda text: re.fullmatch(pattern, text) is not None, rule)

    def _accepted(self, key: str, accepts: Callable[[str], bool], rule: str) -> tuple[str, ...]:
        value = self._value(key)
        if not isinstance(value, list):
            raise self.wrong(key, value, "must be a list of texts")
        for entry in value:
            if not isinstance(entry, str) or not accepts(entry):
                raise self.wrong(key, entry, rule)
        return tuple(value)

    def _text(self, key: str, pattern: str, rule: str) -> str:
        value = self._value(key)
        if not isinstance(value, str) or not re.fullmatch(pattern, value):
            raise self.wrong(key, value, rule)
        return value

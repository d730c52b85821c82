"""Write other figures into a TOML text that a user wrote, and leave their comments, order and layout as they are."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, MutableMapping
from typing import Any

import tomlkit
from tomlkit.exceptions import TOMLKitError


def rewritten(text: str, wanted: str) -> str | None:
    """Return `text` with the values of the document `wanted`; None where that cannot be done and read back alike.

    What both hold alike keeps its line and its comment; a key that is not wanted goes with its comment.
    """
    try:
        document = tomlkit.parse(text)
        _write(document, tomlkit.parse(wanted))
        said = tomlkit.dumps(document)
        return said if tomllib.loads(said) == tomllib.loads(wanted) else None
    except (TOMLKitError, tomllib.TOMLDecodeError, KeyError, ValueError):
        return None


def _write(table: MutableMapping[str, Any], wanted: Mapping[str, Any]) -> None:
    for key in [key for key in table if key not in wanted]:
        del table[key]
    for key, value in wanted.items():
        if key not in table:
            table[key] = value
        elif isinstance(table[key], MutableMapping) and isinstance(value, Mapping):
            _write(table[key], value)
        elif table[key] != value:
            table[key] = value

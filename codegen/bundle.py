"""A Bundle: generated text by relative path, ready to be written or compiled."""

from __future__ import annotations

import os
import secrets
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path


class CodegenError(Exception):
    """A name or a target cannot become C; the message names it, the rule and the way out."""


@dataclass(frozen=True, slots=True)
class Bundle:
    """`files`: relative path -> text. `sources` and `headers` name those a user's build needs.

    `setters`: C type and setter function of each parameter that can be tuned, in the program's order.
    """

    name: str
    program_id: str
    files: Mapping[str, str]
    sources: tuple[str, ...]
    headers: tuple[str, ...]
    setters: tuple[tuple[str, str], ...] = ()


def write_files(files: Mapping[str, str], folder: Path) -> None:
    """Write every file under `folder`, each one whole or not at all (temporary name, then rename)."""
    for relative, text in files.items():
        path = folder / relative
        path.parent.mkdir(parents=True, exist_ok=True)
        temporary = path.with_name(f".{path.name}.{secrets.token_hex(4)}")
        # Unlike mkstemp, this follows the user's umask.
        with temporary.open("x", encoding="utf-8", newline="\n") as stream:
            stream.write(text)
        os.replace(temporary, path)

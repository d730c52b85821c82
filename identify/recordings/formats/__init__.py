"""Find the reader of a recording file by its ending; every file of this folder that has a FORMAT is one reader."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

from firmloop.identify.recordings.table import Misread, RawTable


@dataclass(frozen=True, slots=True)
class Format:
    """`read` turns the bytes of a file into a Table, or says what is wrong with them."""

    endings: tuple[str, ...]
    read: Callable[[bytes], RawTable | Misread]


@cache
def formats() -> tuple[Format, ...]:
    """Every reader of this folder."""
    modules = (importlib.import_module(f"{__name__}.{found.name}") for found in pkgutil.iter_modules(__path__))
    return tuple(module.FORMAT for module in modules)


def known_endings() -> tuple[str, ...]:
    """Every file ending that can be read, in alphabetical order."""
    return tuple(sorted(ending for form in formats() for ending in form.endings))


def find_format(file_name: str) -> Format | None:
    """Return the reader whose ending fits `file_name`, None where there is none."""
    lowered = file_name.lower()
    return next((form for form in formats() if lowered.endswith(form.endings)), None)

"""What a user's build needs beside the C, one file a format: every file of this folder that has FILES is one."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable, Mapping
from functools import cache

from firmloop.codegen.delivery import Delivery

Files = Callable[[Delivery], Mapping[str, str]]


@cache
def formats() -> Mapping[str, Files]:
    """Return every package format by the name of its file: it takes a Delivery and returns text by relative path."""
    names = sorted(module.name for module in pkgutil.iter_modules(__path__))
    return {name: importlib.import_module(f"{__name__}.{name}").FILES for name in names}


def package(delivery: Delivery) -> Mapping[str, str]:
    """Return the folder to copy: the C below src/, and the files of every format."""
    found = {f"src/{name}": text for name, text in delivery.bundle.files.items()}
    for name, files in formats().items():
        made = files(delivery)
        assert not made.keys() & found.keys(), f"{name} prints a file that another format prints"
        found.update(made)
    return {f"{delivery.program.name}/{name}": text for name, text in found.items()}

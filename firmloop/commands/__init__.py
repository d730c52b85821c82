"""Commands: one file each, found by listing this folder and its rooms: NAME, HELP, arguments(parser), run(...).

A command imports what it needs in `run`, so that the help of all of them answers at once.
"""

from __future__ import annotations

import argparse
import importlib
import pkgutil
from collections.abc import Mapping
from functools import cache
from typing import Protocol, cast

from firmloop.console import Console


class Command(Protocol):
    """What a file of this folder holds."""

    NAME: str
    HELP: str

    def arguments(self, parser: argparse.ArgumentParser) -> None:
        """Ask for what the command needs."""

    def run(self, arguments: argparse.Namespace, console: Console) -> int:
        """Do it, tell it, and return the exit status."""


@cache
def _modules() -> Mapping[str, str]:
    """Return the module of every command by the command's name."""
    found = {}
    for each in pkgutil.iter_modules(__path__):
        within = [f"{__path__[0]}/{each.name}"] if each.ispkg else []
        rooms = {one.name: f"{__name__}.{each.name}.{one.name}" for one in pkgutil.iter_modules(within)}
        found.update(rooms if each.ispkg else {each.name: f"{__name__}.{each.name}"})
    return found


def command_names() -> tuple[str, ...]:
    """Return the name of every command, in alphabetical order."""
    return tuple(sorted(_modules()))


def load_command(name: str) -> Command:
    """Return the command called `name`."""
    return cast(Command, importlib.import_module(_modules()[name]))

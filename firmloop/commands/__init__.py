"""Commands: one file each, NAME, HELP, arguments(parser) and run(arguments, console); found by listing this folder.

A command imports what it needs in `run`, so that the help of all of them answers at once.
"""

from __future__ import annotations

import argparse
import importlib
import pkgutil
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


def command_names() -> tuple[str, ...]:
    """Return the name of every command, in alphabetical order."""
    return tuple(found.name for found in pkgutil.iter_modules(__path__))


def load_command(name: str) -> Command:
    """Return the command called `name`."""
    return cast(Command, importlib.import_module(f"{__name__}.{name}"))

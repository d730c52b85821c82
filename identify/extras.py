"""Import a library that an extra of the installation brings, or name the command that installs it."""

from __future__ import annotations

import importlib
from typing import Any


class ToolError(Exception):
    """A tool is missing or failed; the message names it and the command that gets it."""


def extra(library: str, name: str, needed_for: str) -> Any:
    """Return the module `library`, which comes with the extra `name` of firmloop.

    Raises
    ------
    ToolError
        when it is not installed: what needs it, and the command that installs it.
    """
    try:
        return importlib.import_module(library)
    except ModuleNotFoundError as error:
        missing = (error.name or library).partition(".")[0]
        raise ToolError(
            f"{needed_for} needs {missing}, which is not installed; install it with: pip install 'firmloop[{name}]'"
        ) from None

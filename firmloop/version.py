"""Say which firmloop this is."""

from __future__ import annotations

from importlib import metadata


def version() -> str:
    """Return the number of the installed version."""
    try:
        return metadata.version("firmloop")
    except metadata.PackageNotFoundError:
        return "from source"

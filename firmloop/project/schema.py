"""Find the JSON schema of the project file, which is made with the reference pages."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path


def schema_file() -> Path:
    """Return the file of the schema, as installed."""
    return Path(str(files("firmloop").joinpath("reference", "project.schema.json"))).resolve()

"""`firmloop schema`: the JSON schema of the project file."""

from __future__ import annotations

import argparse

from firmloop.console import Console

NAME = "schema"
HELP = "the JSON schema of the project file, for editors that complete TOML"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Ask for the place of the file, if only that is wanted."""
    parser.add_argument("--path", action="store_true", help="where the file is, in place of its text")


def run(arguments: argparse.Namespace, console: Console) -> int:
    """Show the schema, or where it is."""
    from firmloop.project.schema import schema_file

    file = schema_file()
    text = file.read_text(encoding="utf-8")
    console.lines([str(file)] if arguments.path else text.splitlines())
    console.result("schema", str(file) if arguments.path else text)
    return 0

"""Measurements of the product; `python -m bench.NAME --help` tells what one measures, and starts nothing."""

from __future__ import annotations

import ast
import sys
from collections.abc import Collection, Sequence
from pathlib import Path


def _asked_for_help() -> Path | None:
    """Return the file of `python -m bench...` where it is asked for help and has no parser of its own to give it."""
    words = sys.orig_argv
    if not {"-h", "--help"} & set(sys.argv[1:]) or "-m" not in words[:-1]:
        return None
    parts = words[words.index("-m") + 1].split(".")
    stem = Path(__file__).parent.joinpath(*parts[1:])
    file = stem / "__main__.py" if stem.is_dir() else stem.with_suffix(".py")
    own = parts[0] != "bench" or not file.is_file() or "ArgumentParser(" in file.read_text(encoding="utf-8")
    return None if own else file


def named(asked: Sequence[str], known: Collection[str], what: str) -> Sequence[str]:
    """Return what was asked for by name, all that is known where nothing was; end with a sentence if one is none."""
    if strange := [name for name in asked if name not in known]:
        sys.exit(f"{strange[0]!r} is no {what}; there are {', '.join(known)}")
    return asked or list(known)


if _file := _asked_for_help():
    # Before the module itself is imported: its libraries take seconds, and some are installed for it alone.
    print(ast.get_docstring(ast.parse(_file.read_text(encoding="utf-8"))))
    sys.exit(0)

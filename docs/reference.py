"""Write the pages and the schema below docs/reference/ from the code, or check that they are what the code says.

.venv/bin/python docs/reference.py            writes them
.venv/bin/python docs/reference.py --check    status 1 if one is stale
"""

from __future__ import annotations

import sys
from pathlib import Path

from commands_page import commands_page
from library_pages import controllers_page, effects_page, plants_page, targets_page
from project_page import project_page
from project_schema import project_schema

FOLDER = Path(__file__).parent / "reference"
RENEW = "python docs/reference.py"
MARK = f"<!-- Generated from the code; do not edit. Renew: {RENEW} -->\n\n"
PAGES = {
    "project.md": project_page,
    "project.schema.json": project_schema,
    "plants.md": plants_page,
    "effects.md": effects_page,
    "controllers.md": controllers_page,
    "targets.md": targets_page,
    "commands.md": commands_page,
}


def _text(name: str) -> str:
    """Return the whole text of a file; JSON has no place for the mark."""
    return (MARK if name.endswith(".md") else "") + PAGES[name]()


def stale() -> list[str]:
    """Return the pages that are not what the code says."""
    return [
        name
        for name in PAGES
        if not (FOLDER / name).is_file() or (FOLDER / name).read_text(encoding="utf-8") != _text(name)
    ]


if __name__ == "__main__":
    if sys.argv[1:] == ["--check"]:
        old = stale()
        sys.exit(f"stale: {', '.join(f'docs/reference/{name}' for name in old)}; renew: {RENEW}" if old else 0)
    FOLDER.mkdir(exist_ok=True)
    for name in PAGES:
        (FOLDER / name).write_text(_text(name), encoding="utf-8")

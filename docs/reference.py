"""Write the pages below docs/reference/ from the code, or check that they are what the code says.

.venv/bin/python docs/reference.py            writes them
.venv/bin/python docs/reference.py --check    status 1 if one is stale
"""

from __future__ import annotations

import sys
from pathlib import Path

from commands_page import commands_page
from library_pages import controllers_page, effects_page, plants_page, targets_page
from project_page import project_page

FOLDER = Path(__file__).parent / "reference"
RENEW = "python docs/reference.py"
MARK = f"<!-- Generated from the code; do not edit. Renew: {RENEW} -->\n\n"
PAGES = {
    "project.md": project_page,
    "plants.md": plants_page,
    "effects.md": effects_page,
    "controllers.md": controllers_page,
    "targets.md": targets_page,
    "commands.md": commands_page,
}


def stale() -> list[str]:
    """Return the pages that are not what the code says."""
    return [
        name
        for name, page in PAGES.items()
        if not (FOLDER / name).is_file() or (FOLDER / name).read_text(encoding="utf-8") != MARK + page()
    ]


if __name__ == "__main__":
    if sys.argv[1:] == ["--check"]:
        old = stale()
        sys.exit(f"stale: {', '.join(f'docs/reference/{name}' for name in old)}; renew: {RENEW}" if old else 0)
    FOLDER.mkdir(exist_ok=True)
    for name, page in PAGES.items():
        (FOLDER / name).write_text(MARK + page(), encoding="utf-8")

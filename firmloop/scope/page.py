"""Make the one page of the scope from the files in page/: nothing of it comes from elsewhere."""

from __future__ import annotations

import base64
import hashlib
import html
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from firmloop.console import json_of

FOLDER = Path(__file__).parent / "page"
SCRIPTS = (
    "store.js",
    "panes.js",
    "view.js",
    "trigger.js",
    "tunables.js",
    "scope.js",
)  # in the order they stand on one another


@dataclass(frozen=True, slots=True)
class Page:
    """The text, and the policy that lets a browser run these scripts alone and talk to this server alone."""

    text: str
    policy: str


def page_of(facts: Mapping[str, object]) -> Page:
    """Return the page of one watch."""
    style = _text("scope.css")
    script = "\n".join(_text(name) for name in SCRIPTS)
    told = json_of(facts).replace("<", "\\u003c")  # so that no name in it can end the element that holds it
    text = _text("scope.html")
    for mark, put in (
        ("{title}", html.escape(str(facts["name"]))),
        ("{style}", style),
        ("{facts}", told),
        ("{script}", script),
    ):
        text = text.replace(mark, put, 1)
    policy = (
        f"default-src 'none'; style-src {_allowed(style)}; script-src {_allowed(script)}; connect-src 'self'; "
        "img-src data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    )
    return Page(text, policy)


def _text(name: str) -> str:
    return (FOLDER / name).read_text(encoding="utf-8")


def _allowed(text: str) -> str:
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"

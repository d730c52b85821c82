"""Put sections of a page into a notebook, where they disturb nothing around them."""

from __future__ import annotations

from collections.abc import Iterable

STYLE = (
    ".firmloop table { border-collapse: collapse; margin: .6rem 0; }"
    ".firmloop th, .firmloop td { text-align: left; padding: .2rem 1rem .2rem 0; }"
    ".firmloop svg { max-width: 56rem; height: auto; }"
)


def notebook(sections: Iterable[str]) -> str:
    """Return one piece of HTML with a style of its own."""
    return "\n".join([f'<div class="firmloop"><style>{STYLE}</style>', *sections, "</div>"])

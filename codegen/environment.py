"""Set Jinja up once: strict about names, exact about white space, one filter."""

from __future__ import annotations

import re
from importlib.resources import files

import jinja2


def c_comment(text: object) -> str:
    r"""Make any text harmless inside a C comment: printable ASCII, no comment marks, no line splice, no trigraph.

    >>> c_comment("rad/s")
    'rad/s'
    >>> c_comment("V */ system(0); /*\n??/")
    'V * / system(0); / * ? ?/'
    """
    plain = re.sub(r"[^\x20-\x7e]+", " ", str(text)).replace("\\", "|")
    for mark in ("*/", "/*", "??"):
        while mark in plain:
            plain = plain.replace(mark, f"{mark[0]} {mark[1]}")
    return plain.strip()


def text_of(name: str) -> str:
    """Return the text of a file that travels with firmloop, by its path under templates_c/."""
    return files("firmloop").joinpath("templates_c").joinpath(name).read_text(encoding="utf-8")


def _environment() -> jinja2.Environment:
    environment = jinja2.Environment(
        loader=jinja2.FunctionLoader(text_of),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        autoescape=False,  # C, not HTML; what comes from a user passes c_comment or check_identifier
    )
    environment.filters["c_comment"] = c_comment
    return environment


ENVIRONMENT = _environment()


def render(template: str, view: dict[str, object]) -> str:
    """Print one view through one template."""
    return ENVIRONMENT.get_template(template).render(view)

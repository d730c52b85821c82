"""Look a name up in the reference pages, which travel with firmloop: a section, or the rows of tables that it heads."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from importlib.resources import files

from firmloop.project.table import ProjectError

_PAGES = ("plants.md", "controllers.md", "effects.md", "project.md", "targets.md")


@dataclass(frozen=True, slots=True)
class Passage:
    """One thing that a page says: `names` it is about, the `title` of its section, its text, and the table it is of."""

    names: tuple[str, ...]
    title: str
    text: str
    table: str = ""


def explained(name: str) -> tuple[str, ...]:
    """Return what the pages say of `name`: a key, a table such as `plant.parameters`, an effect, a kind, a rule.

    Raises
    ------
    ProjectError
        when they say nothing, with the nearest names.
    """
    passages = _all_passages()
    wanted = name.strip("[]` ")
    found = [each for each in passages if wanted in each.names]
    if not found and "." in wanted:  # a key with its table in front
        table, _, key = wanted.rpartition(".")
        found = [each for each in passages if key in each.names and table == each.table]
    if not found:
        known = sorted({one for each in passages for one in each.names})
        near = difflib.get_close_matches(wanted, known, n=3)
        hint = f"did you mean {' or '.join(map(repr, near))}?" if near else "see docs/reference, or: firmloop schema"
        raise ProjectError(f"explain {name}: no key, effect, plant, controller or rule is called so; {hint}")
    return tuple(f"{each.title}\n{each.text}" if each.title else each.text for each in found)


@cache
def _all_passages() -> tuple[Passage, ...]:
    return tuple(each for page in _PAGES for each in _passages(page))


def _passages(page: str) -> Iterator[Passage]:
    text = files("firmloop").joinpath("reference", page).read_text(encoding="utf-8")
    head, *sections = re.split(r"^## ", text, flags=re.MULTILINE)
    if page == "controllers.md":
        shared = head.split("\n\n")[2]
        keys = [key for key in re.findall(r"`(\w+)`", shared) if key not in ("pid", "controller")]
        yield Passage((*keys, "controller"), "[controller]", _plain(shared), "controller")
    for section in sections:
        heading, _, body = section.partition("\n")
        title = heading.replace("\\", "").strip()
        if page in ("plants.md", "controllers.md") and re.fullmatch(r"\w+", title):
            yield Passage((title,), title, _plain(body.strip()))
            yield from _keys_of_kind(title, body)
        table = _table_name(title) if page == "project.md" else ""
        if table:
            yield Passage((table,), title, _plain(body.strip()))
        rows = tuple(_rows(title, table, body, page))
        yield from rows
        if page == "project.md":
            listed = {name for row in rows for name in row.names}
            for part in body.strip().split("\n\n"):
                spoken = set() if part.startswith(("|", "```")) else set(re.findall(r"`(\w+)`", part)) - listed
                yield from (Passage((key,), title, _plain(part), table) for key in sorted(spoken))


def _table_name(title: str) -> str:
    """Return the dotted name of the table that a section of the project page is about."""
    found = re.match(r"\[+([\w.]+?)(?:\.[A-Z]+)?\]+", title)
    return found.group(1) if found else ""


def _rows(title: str, table: str, body: str, page: str) -> Iterator[Passage]:
    """Yield the rows of tables that begin with a name, each with its column heads where it has several."""
    heads: list[str] = []
    for line in body.splitlines():
        cells = [cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]]
        named = re.match(r"\[?`(\w+)`", cells[0]) if cells else None
        if not cells or cells[0].startswith("---"):
            continue
        if named is None:
            heads = cells
            continue
        says = (
            [cells[1]]
            if len(cells) == 2
            else [f"{head}: {cell}" for head, cell in zip(heads[1:], cells[1:], strict=True) if cell]
        )
        rule = title == "Tuning rules"
        about = (named.group(1), *(re.findall(r"`(\w+)`", cells[-1]) if rule else ()))
        if page in ("plants.md", "controllers.md") and not rule:
            title_of_row = f"a parameter of {title}" if page == "plants.md" else title
            yield Passage(
                about, title_of_row, _plain(f"{named.group(1)}: " + "; ".join(filter(None, cells[1:]))), table
            )
        else:
            yield Passage(about, title, _plain("\n".join([named.group(1), *(f"  {said}" for said in says)])), table)


def _keys_of_kind(kind: str, body: str) -> Iterator[Passage]:
    """Yield each key of a controller kind with the paragraphs that speak of it."""
    listed = re.findall(r"^Keys: ((?:`\w+`(?:, )?)+)\.$", body, re.MULTILINE)
    paragraphs = [part for part in body.split("\n\n") if not part.startswith(("Keys: `", "```"))]
    for key in re.findall(r"`(\w+)`", listed[-1] if listed else ""):
        spoken = [part for part in paragraphs if f"`{key}`" in part]
        spoken = spoken or [part for part in paragraphs if re.search(rf"\b{key}\b", part)]
        said = "\n".join(map(_plain, spoken))
        yield Passage(
            (key,), f"{key}, a key of the controller {kind}", f"{said}\nmore: firmloop explain {kind}", "controller"
        )


def _plain(text: str) -> str:
    """Take the marks of Markdown away that a terminal does not show."""
    text = re.sub(r"^\|[-|]+\|\n", "", text, flags=re.MULTILINE)
    text = re.sub(r"\[(`?[^\]`]+`?)\]\([^)]*\)", r"\1", text)
    text = re.sub(r"^```\w*\n?", "", text, flags=re.MULTILINE)
    return text.replace("\\|", "|").replace("`", "")

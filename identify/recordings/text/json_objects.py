"""Turn objects in JSON into the text of a table; a value in another object is named by its path.

Each stands in a line of its own, or all in one list, however its lines are broken; or the columns are lists in one
object; or each line is a list of values, the first one of their names. A list of objects may stand in an object beside
what else is told of it, and rows beside their names.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

from firmloop.identify.recordings.table import Misread

_DEEPEST = 8  # objects in objects
MOST_DOCUMENT = 1 << 24  # bytes of a text that is one list or object: it takes fifty times as much memory
_STARTING = 60  # lines that a board may say before its first object
_NO_CELL = str.maketrans({",": ";", '"': "'", **dict.fromkeys("\t\n\r\v\f", " ")})  # 1,5 stays no number
_ONE_LINE = 'write each sample in a line of its own, as {"time_s": 0.0, "voltage_V": 6.0}; delete a torn line'
_NAMES_FIRST = 'let the first list hold the names, as ["time_s", "voltage_V", "speed_rad_s"]'
_ONE_KIND = "write the same names in every line, or one file for each kind of line"
_BEGINS = re.compile(r'\s*(\{\s*("|\}|$)|\[\s*([{\["\]]|$))')

Pairs = list[tuple[str, object]]


@dataclass(frozen=True, slots=True)
class ObjectRows:
    """A header and the text of each row, and what a row is counted as."""

    lines: list[str]
    place: str


def begins_json(lines: Sequence[str]) -> int | None:
    """Return the line from which a text is JSON: the first, or one below what a board says when it starts."""
    said = [k for k, line in enumerate(lines[:_STARTING]) if line.strip()]
    found = next((k for k in said if _BEGINS.match(lines[k])), None)
    if found is None or found == said[0]:
        return found
    below = [line for line in lines[found : found + _STARTING] if line.strip()]
    return found if len(below) > 2 and all(line.lstrip().startswith('{"') for line in below) else None


def rows_of_json(text: str, begin: int) -> ObjectRows | Misread:
    """Return a header and, for each object, its values as they stand in it; null is an empty cell."""
    lines = text.split("\n")[begin:]
    whole = None if begin or _is_whole(lines) else _document(text)
    if isinstance(whole, Misread):
        return whole
    place = "line" if whole is None else "sample"
    rows = _rows(enumerate(lines, begin + 1), place) if whole is None else _rows(enumerate(whole, 1), place)
    return rows if isinstance(rows, Misread) else ObjectRows(rows, place)


def _is_whole(lines: list[str]) -> bool:
    """Tell whether the first line holds one object, or a list, that ends in it, and more lines follow."""
    said = [line for line in lines if line.strip()]
    return len(said) > 1 and _loaded(said[0]) is not None


def _document(text: str) -> list[object] | Misread | None:
    """Return the samples of a text that is one list or object; None where it is something else."""
    if len(text) > MOST_DOCUMENT:
        wrong = f"is one document of {len(text):,} bytes in JSON; at most {MOST_DOCUMENT:,} are read as one"
        return Misread("", wrong, "write each sample in a line of its own, as jq -c '.[]' does")
    held = _loaded(text)
    if not isinstance(held, _Object):
        return held if isinstance(held, list) else None
    inner = _samples_within(held)
    if inner is not None:
        return inner
    columns = [values for _, values in held if isinstance(values, list) and not isinstance(values, _Object)]
    if len(columns) < max(len(held), 2):
        return None
    if len({len(each) for each in columns}) > 1:
        sizes = ", ".join(f"{name} {len(values)}" for (name, _), values in zip(held, columns, strict=True))
        return Misread("", f"has lists of different lengths: {sizes[:200]}", "write one value a row for each name")
    names = [name for name, _ in held]
    return [_Object(zip(names, values, strict=True)) for values in zip(*columns, strict=True)]


def _samples_within(held: _Object) -> list[object] | None:
    """Return the only list of objects in an object, or a list of rows under the names beside it; None without one."""
    lists = {name: each for name, each in held if isinstance(each, list) and not isinstance(each, _Object)}
    samples = [each for each in lists.values() if each and all(isinstance(one, _Object) for one in each)]
    if len(samples) == 1:
        return samples[0]
    names, rows = lists.get("columns", []), lists.get("data", [])
    apart = [one for one in rows if not isinstance(one, list) or isinstance(one, _Object) or len(one) != len(names)]
    return [names, *rows] if names and rows and not apart else None


def _loaded(text: str) -> object:
    try:
        return json.loads(text, object_pairs_hook=_Object, parse_float=str, parse_int=str, parse_constant=str)
    except (ValueError, RecursionError):
        return None


def _rows(samples: Iterable[tuple[int, object]], place: str) -> list[str] | Misread:
    names: list[str] = []
    rows: list[str] = []
    for number, sample in samples:
        if isinstance(sample, str) and place == "line" and not sample.strip():
            rows.append("")
            continue
        held = _loaded(sample) if isinstance(sample, str) and place == "line" else sample
        if isinstance(held, list) and not isinstance(held, _Object) and held:
            if not names and all(isinstance(each, str) and not _is_digits(each) for each in held):
                names = [str(each).translate(_NO_CELL).strip() for each in held]
                rows.append("")  # its line is counted
                continue
            if names and len(held) != len(names):
                wrong = f"has {len(held)} values for {len(names)} names"
                return Misread(f"{place} {number}", wrong, "complete the row or delete it")
            held = _Object(zip(names, held, strict=True)) if names else held
        if isinstance(held, list) and not isinstance(held, _Object):
            return Misread(f"{place} {number}", "is a list of values, and nothing gives their names", _NAMES_FIRST)
        if not isinstance(held, _Object):
            return Misread(f"{place} {number}", "is no object in JSON", _ONE_LINE)
        cells = list(_flat(held, "", 0))
        found = [name for name, _ in cells]
        if len(set(found)) < len(found):
            twice = next(name for name in found if found.count(name) > 1)
            return Misread(f"{place} {number}", f"names {twice} twice", "write each name once")
        names = names or found
        if set(found) != set(names):
            apart = sorted(set(found) ^ set(names))[0]
            wrong = f"lacks {apart}, which the first {place} has" if apart in names else f"adds {apart} to the first's"
            return Misread(f"{place} {number}", wrong, _ONE_KIND)
        values = dict(cells)
        rows.append(",".join(values[name] for name in names))
    return [",".join(names), *rows]


def _is_digits(text: str) -> bool:
    return bool(re.fullmatch(r"-?\d.*|nan|-?inf(inity)?", text, re.IGNORECASE))


class _Object(Pairs):
    """The names and values of an object in their order, those that stand twice among them."""


def _flat(value: object, path: str, depth: int) -> Iterator[tuple[str, str]]:
    if isinstance(value, list) and depth < _DEEPEST:
        pairs = value if isinstance(value, _Object) else [(str(k), each) for k, each in enumerate(value)]
        for key, each in pairs:
            name = str(key).translate(_NO_CELL).strip()
            yield from _flat(each, f"{path}.{name}" if path else name, depth + 1)
    elif isinstance(value, bool):
        yield path, str(int(value))
    else:
        yield path, "" if value is None else str(value).translate(_NO_CELL).strip()

"""Turn lines that each hold an object in JSON into the text of a table; a value in another is named by its path."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator

from firmloop.identify.recordings.table import Misread

_DEEPEST = 8  # objects in objects
_NO_CELL = str.maketrans({",": ";", '"': "'", **dict.fromkeys("\t\n\r\v\f", " ")})  # 1,5 stays no number
_ONE_LINE = 'write each sample in a line of its own, as {"time_s": 0.0, "voltage_V": 6.0}; delete a torn line'
_ONE_KIND = "write the same names in every line, or one file for each kind of line"

Pairs = list[tuple[str, object]]


def are_json_lines(lines: list[str]) -> bool:
    """Tell whether the first line that holds anything begins as JSON does, of an object or of a list of some."""
    first = next((line for line in lines if line.strip()), "")
    return bool(re.match(r'\s*(\{\s*("|\}|$)|\[\s*(\{|\[|$))', first))


def rows_of_json(lines: list[str]) -> list[str] | Misread:
    """Return a header and, for each line, its values as they stand in it; null is an empty cell."""
    names: list[str] = []
    rows = []
    for number, line in enumerate(lines, 1):
        if not line.strip():
            rows.append("")
            continue
        try:
            held = json.loads(line, object_pairs_hook=_Object, parse_float=str, parse_int=str, parse_constant=str)
        except (ValueError, RecursionError):
            return Misread(f"line {number}", "is no object in JSON", _ONE_LINE)
        if not isinstance(held, _Object):
            return Misread(f"line {number}", "is no object in JSON", _ONE_LINE)
        cells = list(_flat(held, "", 0))
        found = [name for name, _ in cells]
        if len(set(found)) < len(found):
            twice = next(name for name in found if found.count(name) > 1)
            return Misread(f"line {number}", f"names {twice} twice", "write each name once")
        names = names or found
        if set(found) != set(names):
            apart = sorted(set(found) ^ set(names))[0]
            wrong = (
                f"lacks {apart}, which the first line has" if apart in names else f"adds {apart} to the first line's"
            )
            return Misread(f"line {number}", wrong, _ONE_KIND)
        values = dict(cells)
        rows.append(",".join(values[name] for name in names))
    return [",".join(names), *rows]


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

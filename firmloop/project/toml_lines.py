"""Find the line of every key of a TOML text, because tomllib forgets them and an error should name one."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping

TOKEN = re.compile(
    r'(?P<text>"""(?:\\.|[^\\])*?"""|\'\'\'.*?\'\'\'|"(?:\\.|[^"\\\n])*"|\'[^\'\n]*\')'
    r"|(?P<comment>#[^\n]*)|(?P<newline>\n)|(?P<sign>[\[\]{}=,.])|(?P<bare>[A-Za-z0-9_\-]+)|(?P<other>.)",
    re.DOTALL,
)

Path = tuple[str, ...]


def key_lines(text: str) -> Mapping[Path, int]:
    """Return the line (from 1) of every table and key of a TOML text that tomllib has already accepted.

    A key is the path of its names; the tables of an array of tables carry their position: `("effects", "0", "name")`.
    """
    lines: dict[Path, int] = {}
    counts: dict[Path, int] = {}
    table: Path = ()
    for statement in _statements(text):
        line = statement[0][1]
        words = [word for word, _ in statement]
        if words[0] == "[":
            double = words[1:2] == ["["]
            table = _placed(tuple(_plain(word) for word in words if word not in "[]."), counts)
            if double:
                counts[table] = counts.get(table, -1) + 1
                table = (*table, str(counts[table]))
            lines.setdefault(table, line)
        elif "=" in words:
            _pair(statement, 0, table, lines)
    return lines


def _statements(text: str) -> Iterator[list[tuple[str, int]]]:
    """Yield the tokens of one header or one pair at a time; brackets may carry a pair over several lines."""
    statement: list[tuple[str, int]] = []
    depth = 0
    line = 1
    for match in TOKEN.finditer(text):
        kind, word = match.lastgroup, match.group()
        if kind in ("sign", "bare", "text") or (kind == "other" and not word.isspace()):
            statement.append((word, line))
            depth += (word in ("[", "{")) - (word in ("]", "}"))
        elif kind == "newline" and depth == 0 and statement:
            yield statement
            statement = []
        line += word.count("\n")
    if statement:
        yield statement


def _pair(tokens: list[tuple[str, int]], at: int, table: Path, lines: dict[Path, int]) -> int:
    """Note the key that begins at token `at` and the keys of an inline table behind it; return where it ends."""
    first_line = tokens[at][1]
    path = table
    while tokens[at][0] != "=":
        if tokens[at][0] != ".":
            path = (*path, _plain(tokens[at][0]))
        at += 1
    for length in range(len(table) + 1, len(path) + 1):
        lines.setdefault(path[:length], first_line)
    return _value(tokens, at + 1, path, lines)


def _value(tokens: list[tuple[str, int]], at: int, path: Path, lines: dict[Path, int]) -> int:
    """Walk over one value; return the place of the comma or bracket behind it."""
    depth = 0
    while at < len(tokens):
        word = tokens[at][0]
        if word == "{" and depth == 0:
            at += 1
            while tokens[at][0] != "}":
                at = at + 1 if tokens[at][0] == "," else _pair(tokens, at, path, lines)
        elif depth == 0 and word in (",", "}"):
            return at
        else:
            depth += (word in ("[", "{")) - (word in ("]", "}"))
        at += 1
    return at


def _placed(path: Path, counts: Mapping[Path, int]) -> Path:
    """Put the position of the latest element behind each array of tables that `path` passes through."""
    placed: Path = ()
    for name in path[:-1]:
        placed = (*placed, name)
        if placed in counts:
            placed = (*placed, str(counts[placed]))
    return (*placed, path[-1])


def _plain(word: str) -> str:
    """Return a key without its quotes."""
    if word.startswith('"'):
        return str(json.loads(word)) if "\\U" not in word else word[1:-1]
    return word.strip("'")

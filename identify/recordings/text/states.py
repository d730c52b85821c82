"""Read a column of two words that say how something stands, such as ON and OFF, as 1 and 0."""

from __future__ import annotations

from itertools import islice

from firmloop.identify.recordings.text.cells import bare, split_cells
from firmloop.identify.recordings.text.lines import Lines, last_filled

_PAIRS = (  # the first of each is 1
    *("on off", "true false", "high low", "open closed", "open close", "yes no", "enabled disabled", "enable disable"),
    *("active inactive", "heating idle", "heat idle", "ein aus", "an aus", "wahr falsch", "marche arret"),
    *("marche arr\u00eat", "vrai faux", "ouvert ferme", "ouvert ferm\u00e9", "acceso spento", "encendido apagado"),
    "ligado desligado",
)
_WAYS = ("forward reverse", "forward backward", "fwd rev", "cw ccw")  # of a drive: the second is -1
_VALUES = {
    frozenset(pair.split()): dict(zip(pair.split(), (1, other), strict=True))
    for pairs, other in ((_PAIRS, 0), (_WAYS, -1))
    for pair in pairs
}
_WORDS = frozenset(word for pair in _VALUES for word in pair)
_MARKS = "\t;|,"


def value_of(words: set[str]) -> dict[str, int]:
    """Return which number each of two words in small letters stands for; nothing where they are no such pair."""
    return _VALUES.get(frozenset(words), {})


def with_states(lines: Lines) -> tuple[Lines, dict[int, tuple[str, str]]]:
    """Return the lines with numbers in such columns; of each, by its place, what it holds and how that is read."""
    last = next(iter(last_filled(lines.text, 1)), "")
    mark = next((each for each in _MARKS if each in last), "")
    cells = split_cells(last, mark) if mark else []
    places = [k for k, cell in enumerate(cells) if bare(cell).lower() in _WORDS]
    if not places:
        return lines, {}
    found: dict[int, set[str]] = {k: set() for k in places}
    first = _first_row(lines, mark, len(cells), places)
    for line in islice(lines, first, None):
        row = split_cells(line, mark)
        for k in places if len(row) == len(cells) else ():
            found[k].add(bare(row[k]).lower())
    values = {k: value for k, words in found.items() if (value := value_of(words))}
    if not values:
        return lines, {}

    def in_numbers(line: str) -> str:
        row = split_cells(line, mark)
        if len(row) != len(cells) or any(bare(row[k]).lower() not in value for k, value in values.items()):
            return line
        made = [str(values[k][bare(cell).lower()]) if k in values else cell for k, cell in enumerate(row)]
        return mark.join(f'"{cell}"' if mark in cell else cell for cell in made)

    told = {
        k: (f"holds {bare(cells[k])!r}", ", ".join(f"{number} for {word}" for word, number in value.items()))
        for k, value in values.items()
    }
    return Lines.of(map(in_numbers, lines)), told


def _first_row(lines: Lines, mark: str, width: int, places: list[int]) -> int:
    """Return the index of the first line that has a state in every one of these places: those above are no rows."""
    for k, line in enumerate(lines):
        row = split_cells(line, mark)
        if len(row) == width and all(bare(row[place]).lower() in _WORDS for place in places):
            return k
    return 0

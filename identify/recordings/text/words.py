"""Set columns of a text aside that hold words in every row, such as a state or an empty column."""

from __future__ import annotations

import re

from firmloop.identify.recordings.text.cells import is_number, split_cells
from firmloop.identify.recordings.text.lines import Lines

_MARKS = ("\t", ";", "|", ",", " ")
_FEWEST = 3  # rows that make a table
_FEWEST_NUMBERS = 2  # in a row: a time and one signal
_SHOWN = 20  # letters of a word
_NO_NUMBER = re.compile(r"[^\W\d_]|^[^-+.,\d]")
ASIDE = "nan"  # stands in place of a word


def without_words(lines: Lines) -> tuple[Lines, dict[int, str], str]:
    """Return the lines with `nan` in those columns, what each of them holds by its place, and what is told of it.

    Rows are the lines that have numbers and words where the last line has them. The first mark that parts the last line
    into numbers and words is the one between columns: no other is tried, as a decimal comma would part it otherwise.
    """
    last = next((line for line in reversed(lines) if line.strip()), "")
    for mark in _MARKS:
        cells = _cells(last, mark)
        end = max((k + 1 for k, cell in enumerate(cells) if cell.strip()), default=0)
        end = max(end, _last_empty(lines, mark, len(cells), end)) if len(cells) > end >= _FEWEST_NUMBERS else end
        words = tuple(k for k, cell in enumerate(cells[:end]) if _is_word(cell))
        numbers = tuple(k for k, cell in enumerate(cells[:end]) if _is_number(cell))
        if len(numbers) == end >= _FEWEST_NUMBERS:
            break  # a row of numbers: its decimal commas part no columns
        if not words or len(numbers) < _FEWEST_NUMBERS or len(words) + len(numbers) < end:
            continue
        out, rows, filled = _aside(lines, mark, len(cells), words, numbers)
        if rows < max(_FEWEST, filled + 1):  # a column of numbers, of which some readings failed, is none of words
            break
        shown = {j: repr(_bare(cells[j])[:_SHOWN]) if _bare(cells[j]) else "" for j in words}
        told = ", ".join(dict.fromkeys(each or "empty" for each in shown.values()))
        held = "a column" if len(words) == 1 else f"{len(words)} columns"
        part = f" in {rows} of {rows + filled} rows" if filled else ""
        without = f"with words{part}" if filled else "without numbers"
        holds = {j: f"{f'holds {word}' if word else 'is empty'}{part}" for j, word in shown.items()}
        return out, holds, f"has {held} {without}, left aside: {told}"
    return lines, {}, ""


def _aside(
    lines: Lines, mark: str, width: int, words: tuple[int, ...], numbers: tuple[int, ...]
) -> tuple[Lines, int, int]:
    """Return the lines with `nan` for words, in how many there are words, and in how many numbers in their place."""
    rows = filled = 0

    def aside(line: str) -> str:
        nonlocal rows, filled
        row = _cells(line, mark)
        if len(row) != width or not all(_is_number(row[j]) for j in numbers):
            return line
        if not all(_is_word(row[j]) for j in words):
            filled += any(_is_number(row[j]) for j in words)
            return line
        rows += 1
        return mark.join(ASIDE if j in words else f'"{cell}"' if mark in cell else cell for j, cell in enumerate(row))

    return Lines.of(map(aside, lines)), rows, filled


def _last_empty(lines: Lines, mark: str, width: int, end: int) -> int:
    """Return up to which column a header names columns behind the `end` that are empty in every row; 0 where none."""
    rows = [cells[end:] for line in lines if len(cells := _cells(line, mark)) == width]
    if len(rows) < 2 or any(_bare(cell) for row in rows[1:] for cell in row):
        return 0
    return end + max((k + 1 for k, cell in enumerate(rows[0]) if _bare(cell) and not _is_number(cell)), default=0)


def _cells(line: str, mark: str) -> list[str]:
    if mark == " ":
        return line.split()
    return split_cells(line, mark)


def _bare(cell: str) -> str:
    return cell.strip().strip('"').strip()


def _is_word(cell: str) -> bool:
    bare = _bare(cell)
    # What begins with a sign that no number has is none, though it may go on in digits: *25, a sum to check by.
    return not bare or (bool(_NO_NUMBER.search(bare)) and not _is_number(cell))


def _is_number(cell: str) -> bool:
    return is_number(cell.replace(",", "."))

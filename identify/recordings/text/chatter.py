"""Tell what a board says between its rows, such as [WARN] i2c timeout, from rows that are torn."""

from __future__ import annotations

import re

import numpy as np
from numpy.typing import NDArray

from firmloop.identify.recordings.text.cells import bare, is_number

_WORD = re.compile(r"[^\W\d_]{2}")
_SHOWN = 5  # lines that are named
_MOST = 0.5  # of the lines


def without_chatter(
    names: tuple[str, ...], rows: list[str], numbers: NDArray[np.int64], delimiter: str
) -> tuple[list[str], NDArray[np.int64], str]:
    """Leave out lines of words, none of whose cells is a number, behind the first row.

    Returns the rows that are left, their line numbers, and what to tell; blank where nothing was left out, or too much.
    """
    says = np.array([_is_chatter(row, names, delimiter) for row in rows])
    if says[0] or not np.any(says) or np.mean(says) > _MOST:
        return rows, numbers, ""
    count = int(np.sum(says))
    said = [(int(numbers[k]), rows[k].strip()[:40]) for k in np.flatnonzero(says)[:_SHOWN]]
    told = ", ".join(f"{number} {text!r}" for number, text in said) + (", ..." if count > _SHOWN else "")
    kept = [row for row, away in zip(rows, says, strict=True) if not away]
    between = f"{count} line{'s are' if count > 1 else ' is'} between rows and no row, left aside: line {told}"
    return kept, numbers[~says], f"has words of the board: {between}"


def _is_chatter(row: str, names: tuple[str, ...], delimiter: str) -> bool:
    if not _WORD.search(row):
        return False
    cells = [bare(cell) for cell in row.split(delimiter)]
    return tuple(cells) != names and not any(map(is_number, cells))


def listed_lines(numbers: list[int]) -> str:
    """Name the first of several lines."""
    return ", ".join(map(str, numbers[:_SHOWN])) + (", ..." if len(numbers) > _SHOWN else "")

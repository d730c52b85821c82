"""Read rows in which most cells of some columns are empty: signals of several rates that were written into one table.

Each column has the times of the rows that it stands in, and all are held on those of the quickest, see `groups.py`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import islice

import numpy as np

from firmloop.identify.recordings.columns import tells_time
from firmloop.identify.recordings.groups import Group, Vector, table_of_groups
from firmloop.identify.recordings.table import Misread, RawTable
from firmloop.identify.recordings.text.calendar_stamps import with_seconds
from firmloop.identify.recordings.text.cells import bare_cells, is_number
from firmloop.identify.recordings.text.lines import Lines

_LOOKED, _FEWEST = 50, 3  # rows that are looked at first; values that make a column
_FILLED = 0.5  # of the rows: a column that has more lacks readings that failed


def read_sparse(lines: Lines) -> RawTable | Misread | None:
    """Return the columns on common instants, None where no column is that empty, or something else is in a row."""
    said = [line for line in islice(lines, _LOOKED) if line.strip()]
    mark = next((each for each in "\t;|," if said and said[0].count(each) > 1), "")
    head = bare_cells(said[0], mark) if mark else []
    rows = [bare_cells(line, mark) for line in said[1:]] if mark else []
    if any(map(is_number, head)) or not all(head) or not any("" in row for row in rows):
        return None
    seconds, told, stamped = with_seconds(lines)
    found = [bare_cells(line, mark) for line in seconds if line.strip()][1:]
    if any(len(row) != len(head) for row in found):
        return None
    texts = [tuple(cell.replace(",", ".") for cell in column) for column in zip(*found, strict=True)]
    words = {k: holds for k, column in enumerate(texts) if (holds := _words_of(column))}
    texts = [() if k in words else column for k, column in enumerate(texts)]
    filled = [np.array(list(map(bool, column))) for column in texts]
    timed = [k for k, name in enumerate(head) if k not in words and (k == stamped or tells_time(name))]
    clock = next((k for k in timed if np.all(filled[k])), None)
    rest = [k for k in range(len(head)) if k not in words and k != clock]
    if clock is None or not rest or not all(is_number(cell) for column in texts for cell in column if cell):
        return None
    if min(int(np.sum(filled[k])) for k in rest) < _FEWEST or min(float(np.mean(filled[k])) for k in rest) > _FILLED:
        return None
    time = np.array(texts[clock], dtype=np.float64)
    vectors: dict[bytes, list[Vector]] = {}
    for k in rest:
        column = np.array([cell for cell in texts[k] if cell], dtype=np.float64)
        vectors.setdefault(filled[k].tobytes(), [("time_s", time[filled[k]], "")]).append((head[k], column, ""))
    groups = [Group(" and ".join(name for name, *_ in each[1:]), tuple(each)) for each in vectors.values()]
    table = table_of_groups(groups, "write each row with a value in every column")
    if isinstance(table, Misread):
        return table
    return replace(
        table,
        names=tuple(head[clock] if name == "time_s" else name for name in table.names),
        units=tuple("s" if name == "time_s" else "" for name in table.names) if told else (),
        notes=(
            "has empty cells, for its columns are read at different times",
            *table.notes,
            *filter(None, (told,)),
        ),
        words={head[k]: holds for k, holds in words.items()},
    )


def _words_of(column: Sequence[str]) -> str:
    """Say what a column without a number holds; empty where it has one."""
    said = next(filter(None, column), "")
    return "" if any(map(is_number, column)) else f"holds {said[:20]!r}" if said else "is empty"

"""A long text is read block by block: in memory for itself and its columns, and as if it were one block."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest

from firmloop.identify.recordings.formats import find_format
from firmloop.identify.recordings.table import RawTable
from firmloop.identify.recordings.text import lines

ROWS = 40_000
HEADER = "time_s,voltage_V,speed_rad_s"
VALUES = [(0.001 * k, 6.0 * (k // 200 % 2), 0.0625 * (k % 1000)) for k in range(ROWS)]
PLAIN = "\n".join([HEADER, *(f"{time:.3f},{drive:g},{speed:.4f}" for time, drive, speed in VALUES), ""])
WRITTEN = {
    "plain": PLAIN,
    "ends of lines as on Windows": PLAIN.replace("\n", "\r\n"),
    "semicolons": PLAIN.replace(",", ";"),
    "semicolons and decimal commas": PLAIN.replace(",", ";").replace(".", ","),
    "spaces": PLAIN.replace(",", "  "),
    "a preamble": f"# bench 3\n{PLAIN}",
    "a line of units": PLAIN.replace(HEADER, f"{HEADER}\ns,V,rad/s"),
    "a delimiter at every end": PLAIN.replace("\n", ",\n"),
    "a column of words": PLAIN.replace("\n", ",run\n").replace(f"{HEADER},run", f"{HEADER},state"),
    "stamps": "\n".join(
        [
            HEADER,
            *(
                f"{10 + k // 3_600_000}:{k // 60_000 % 60:02d}:{k // 1000 % 60:02d}.{k % 1000:03d},1,{k % 7}"
                for k in range(ROWS)
            ),
        ]
    ),
    "quotes": PLAIN.replace(",", '","').replace("\n", '"\n"').removesuffix('"'),
    "frames": PLAIN.replace("\n", ">\n<").removesuffix("<").replace(f"{HEADER}>", HEADER),
}


def read(content: bytes) -> RawTable:
    form = find_format("long.csv")
    assert form is not None
    table = form.read(content)
    assert isinstance(table, RawTable), table
    return table


@pytest.mark.parametrize("way", WRITTEN)
def test_a_long_text_takes_memory_for_itself_and_its_columns(way: str) -> None:
    content = WRITTEN[way].encode()
    tracemalloc.start()
    try:
        table = read(content)
        most = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert len(table.places) == ROWS
    assert most < 3.2 * (len(content) + sum(values.nbytes for values in table.columns))


@pytest.mark.parametrize("way", WRITTEN)
def test_a_text_of_many_blocks_reads_as_one_of_one(way: str, monkeypatch: pytest.MonkeyPatch) -> None:
    content = "".join(WRITTEN[way].splitlines(keepends=True)[:300]).encode()
    whole = read(content)
    for name, size in (("_BLOCK", 37), ("_JOINED", 3), ("_LOOKED", 16)):
        monkeypatch.setattr(lines, name, size)
    parts = read(content)
    assert (parts.names, parts.units, parts.notes, parts.words) == (whole.names, whole.units, whole.notes, whole.words)
    np.testing.assert_array_equal(parts.places, whole.places)
    np.testing.assert_array_equal(parts.columns, whole.columns)

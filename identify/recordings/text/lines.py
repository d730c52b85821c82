"""Cut the lines of a long text out of it as they are asked for: a list of them takes five times as much memory."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable, Iterator, Sequence
from itertools import accumulate, chain, islice
from typing import overload

_BLOCK = 1 << 16  # letters that are cut into lines at a time
_JOINED = 1 << 10  # lines that are joined at a time
_LOOKED = 1 << 13  # letters that are looked at for the last lines, at first


class Lines(Sequence[str]):
    """The lines of `text`, which newlines part, without returns at their ends."""

    def __init__(self, text: str) -> None:
        self.text = text
        self._begins, end = [0], text.find("\n", _BLOCK)
        while end >= 0:
            self._begins.append(end + 1)
            end = text.find("\n", end + 1 + _BLOCK)
        self._ends = [*(begin - 1 for begin in self._begins[1:]), len(text)]
        counts = (text.count("\n", *block) + 1 for block in zip(self._begins, self._ends, strict=True))
        self._first = [0, *accumulate(counts)]  # line of each block
        self._held: tuple[int, list[str]] = -1, []

    @classmethod
    def of(cls, lines: Iterable[str]) -> Lines:
        """Keep lines, one of which at least there is, as one text."""
        parts = iter(lines)
        return cls("\n".join("\n".join(part) for part in iter(lambda: [*islice(parts, _JOINED)], [])))

    def __len__(self) -> int:
        return self._first[-1]

    @overload
    def __getitem__(self, place: int) -> str: ...
    @overload
    def __getitem__(self, place: slice) -> list[str]: ...
    def __getitem__(self, place: int | slice) -> str | list[str]:
        if isinstance(place, slice):
            return [self[k] for k in range(*place.indices(len(self)))]
        line = range(len(self))[place]
        block = bisect_right(self._first, line) - 1
        if self._held[0] != block:
            self._held = block, self._cut(block)
        return self._held[1][line - self._first[block]]

    def __iter__(self) -> Iterator[str]:
        return chain.from_iterable(map(self._cut, range(len(self._begins))))

    def _cut(self, block: int) -> list[str]:
        text = self.text[self._begins[block] : self._ends[block]]
        lines = text.split("\n")
        return [line.rstrip("\r") for line in lines] if "\r" in text else lines


def last_filled(text: str, count: int) -> list[str]:
    """Return the last `count` lines, of any kind of end, that hold more than blanks; all where there are fewer."""
    size = _LOOKED
    while True:
        cut = text[-size:].splitlines()
        lines = [line for line in (cut[1:] if size < len(text) else cut) if line.strip()]
        if len(lines) >= count or size >= len(text):
            return lines[-count:]
        size *= 4

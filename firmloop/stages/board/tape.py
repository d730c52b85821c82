"""Keep the samples of a running controller as they come: one writes, any number read at their own pace."""

from __future__ import annotations

import threading
from bisect import bisect_right
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from firmloop.verify.reference import Raw


@dataclass(frozen=True, slots=True)
class Setting:
    """A parameter to be set to the raw `value` (1,) once `after` steps have been seen; before the first one if 0."""

    name: str
    value: Raw
    after: int


@dataclass(frozen=True, slots=True)
class Made:
    """A setting that was made, and the first step that it acted on."""

    setting: Setting
    step: int


def steps_after(first: int, step: int) -> int:
    """Return how many steps after the first one a step is, 0 if it is before; both are counted in 32 bits."""
    passed = (step - first) & 0xFFFFFFFF
    return passed if passed < 1 << 31 else 0


@dataclass(frozen=True, slots=True)
class Seen:
    """What came: raw rows in order, samples lost in the image for want of line, and on the line, and what was set."""

    rows: NDArray[np.void]
    lost_in_image: int
    lost_on_line: int
    made: tuple[Made, ...] = ()


class Tape:
    """Raw rows of every `every`-th step, each with its number in the field `step`, of 32 bits as the image counts."""

    def __init__(self, every: int) -> None:
        self._every = every
        self._blocks: list[NDArray[np.void]] = []
        self._ends: list[int] = []  # rows up to the end of each block
        self._lost = 0
        self._passed = 0
        self._made: list[Made] = []
        self._closed = False
        self._news = threading.Condition()

    def append(self, rows: NDArray[np.void], lost: int, passed: int) -> None:
        """Keep more rows; the image has lost so many, and the last of them is `passed` steps after the first."""
        with self._news:
            self._blocks.append(rows)
            self._ends.append(len(self) + len(rows))
            self._lost, self._passed = lost, passed
            self._news.notify_all()

    def note(self, made: Made) -> None:
        """Keep what was set."""
        self._made.append(made)

    def close(self) -> None:
        """Say that nothing more comes."""
        with self._news:
            self._closed = True
            self._news.notify_all()

    @property
    def closed(self) -> bool:
        """Tell whether nothing more comes."""
        return self._closed

    @property
    def made(self) -> tuple[Made, ...]:
        """What was set so far."""
        return tuple(self._made)

    def __len__(self) -> int:
        return self._ends[-1] if self._ends else 0

    @property
    def missing(self) -> int:
        """How many samples between the first and the last are not there."""
        return self._passed // self._every + 1 - len(self) if self._ends else 0

    @property
    def first(self) -> int:
        """The number of the first step; 0 while none has come."""
        return int(self._blocks[0]["step"][0]) if self._ends else 0

    def follow(self, begin: int, most: int, patience: float) -> Iterator[NDArray[np.void]]:
        """Yield the rows from number `begin` on, at most `most` at once; none after `patience` s without a new one.

        It ends once the tape is closed and all of it was given.
        """
        while self._await(begin, patience):
            rows = self.read(begin, most)
            yield rows
            begin += len(rows)

    def _await(self, begin: int, patience: float) -> bool:
        """Wait until there are more than `begin` rows; return False once there never will be."""
        with self._news:
            self._news.wait_for(lambda: len(self) > begin or self._closed, patience)
            return len(self) > begin or not self._closed

    def read(self, begin: int, most: int) -> NDArray[np.void]:
        """Return the rows from number `begin` on, `most` of them or as many as there are."""
        with self._news:
            k = bisect_right(self._ends, begin)
            at = begin - (self._ends[k - 1] if k else 0)
            taken: list[NDArray[np.void]] = []
            while most > 0 and k < len(self._blocks):
                taken.append(self._blocks[k][at : at + most])
                most -= len(taken[-1])
                k, at = k + 1, 0
        return np.concatenate(taken) if taken else np.zeros(0, [("step", "<u4")])

    def seen(self, steps: int) -> Seen:
        """Return what came of the first `steps` steps."""
        rows = np.concatenate(self._blocks)
        passed = rows["step"] - rows["step"][0]  # of 32 bits, as the steps are: right where they begin anew
        rows, passed = rows[passed < steps], passed[passed < steps]
        missing = int(passed[-1]) // self._every + 1 - len(rows)
        in_image = min(missing, self._lost)
        return Seen(rows, in_image, missing - in_image, tuple(self._made))

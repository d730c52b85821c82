"""A Course drives a simulation over some rows of a recording; an Engine runs it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

MOST_STEPS = 400.0  # a row: a plant stiffer than that explains nothing, and would hold up a search for minutes
LONGEST_CHANGE = 0.3  # rate of change of what is not linear, times the step, up to which a step is exact enough


@dataclass(frozen=True, slots=True)
class Course:
    """What drives a simulation: `time` (n,) in s, `drive` (n, m) the inputs as recorded, row distances in s.

    The simulation runs from row `first` up to, not including, row `end`; inputs of earlier rows may still be on their
    way through a delay.
    """

    time: Array
    drive: Array
    step: float  # s, typical
    longest: float  # s
    first: int
    end: int
    knots: tuple[Array, Array] | None = None  # moments (k,) and values (k, m) of straight lines; None: rows are held
    longest_change: float = LONGEST_CHANGE  # rate of change of what is not linear, times the longest step taken
    most_steps: float = 0.0  # of a simulation, after which it counts as diverged; 0: any number
    turn: Array | None = None  # (n,) rad: the angle that waves per turn follow, where it is not the simulated one
    lost: float = math.inf  # rad, by which the simulated one is off: less than a quarter of a wave's period is none


class Engine(Protocol):
    """The compiled equations of a plant. Arrays in and out are in the units of the plant's signals."""

    @property
    def states(self) -> int:
        """Number of initial states."""
        ...

    @property
    def outputs(self) -> int:
        """Number of outputs."""
        ...

    @property
    def sticking(self) -> Sequence[int]:
        """The states that dry friction can hold at rest."""
        ...

    def run(self, course: Course, constants: Array, start: Array) -> Array:
        """Return the outputs (q, r) from state `start` in the first row; rows after a divergence are NaN."""
        ...

    def run_with_slopes(
        self, course: Course, constants: Array, start: Array, which: Sequence[int]
    ) -> tuple[Array, Array]:
        """Also return dy/d(constants[which], start): (q, r, len(which) + number of states)."""
        ...

    def usual_state(self, course: Course, constants: Array, start: Array) -> Array:
        """Return where the plant is on average (n,) on its way from `start`: another guess for where it began."""
        ...

    def steps_of(self, course: Course, constants: Array, start: Array) -> float:
        """Return how many steps a run takes, where that depends on the constants."""
        ...

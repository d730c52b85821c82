"""What a nameless term may follow: where a machine is, how it came there, when, or how warm that has made it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from firmloop.diagnose.policy import (
    HARMONICS,
    HATS,
    RARE_DEVIATIONS,
    SPRING_MEMORIES_S,
    TELLING_DRIVE,
    WARM_SHARES,
)
from firmloop.identify.simulation.linear_filter import filtered

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Coordinate(ABC):
    """What a term could follow: `values` (n,) of every recording."""

    name: str
    values: tuple[Array, ...]

    @property
    def level(self) -> bool:
        """Tell whether a constant is one of its shapes."""
        return False

    @property
    def searched(self) -> int:
        """Return how many figures were read off the recordings before the term is weighed: each has its price."""
        return 0

    @property
    def own(self) -> bool:
        """Tell whether every recording has a size of the term of its own."""
        return False

    @abstractmethod
    def columns(self, index: int) -> Array:
        """Return what is known of the term (n, b) in one recording, but for its b unknowns."""

    def law(self, answer: Array) -> Array:
        """Return points (m, 2) of the coordinate and the term, whose unknowns are `answer` (b,); none of no curve.

        A term that depends on how it came where it is follows no curve.
        """
        return np.zeros((0, 2))


@dataclass(frozen=True, slots=True)
class Curve(Coordinate):
    """A curve over the coordinate: of hats, of waves around a turn, or straight on either side of zero (`bent`)."""

    periodic: bool = False
    bent: bool = False
    factor: tuple[Array, ...] | None = None  # multiplies the term

    @property
    def level(self) -> bool:
        """See `Coordinate`."""
        return not self.periodic and self.factor is None

    def columns(self, index: int) -> Array:
        """See `Coordinate`."""
        found = self.shapes(self.values[index])
        return found if self.factor is None else found * self.factor[index][:, None]

    def shapes(self, at: Array) -> Array:
        """Return hats or waves (n, b) at `at` (n,)."""
        if self.periodic:
            waves = [wave(order * at) for order in range(1, HARMONICS + 1) for wave in (np.sin, np.cos)]
            return np.stack(waves, axis=1)
        knots = self._centres()
        return np.stack([np.interp(at, knots, row) for row in np.eye(len(knots))], axis=1)

    def law(self, answer: Array) -> Array:
        """See `Coordinate`."""
        centres = self._centres()
        return np.column_stack([centres, self.shapes(centres) @ answer])

    def _centres(self) -> Array:
        """Return where the curve is drawn: the tops of the hats, or points around a turn."""
        if self.periodic:
            return np.linspace(0.0, 2.0 * np.pi, 25)
        every = np.concatenate(self.values)
        if self.bent:
            return np.array([every.min(), 0.0, every.max()])
        return np.unique(np.quantile(every, np.linspace(0.0, 1.0, HATS)))


@dataclass(frozen=True, slots=True)
class Carried(Curve):
    """A mass or inertia that is a curve over the place: it takes a force to speed it up, and to carry it in or out.

    Of a mass m(x) that is m(x) a + m'(x) v^2 / 2 (Lagrange), for speeds v (n,); `step` in s.
    """

    speeds: tuple[Array, ...] = ()
    step: float = 0.0

    def columns(self, index: int) -> Array:
        """See `Coordinate`."""
        shapes, speed = self.shapes(self.values[index]), self.speeds[index]
        gained = np.gradient(speed, self.step)[:, None] * shapes
        return -(gained + 0.5 * speed[:, None] * np.gradient(shapes, self.step, axis=0))


@dataclass(frozen=True, slots=True)
class Wave(Coordinate):
    """A wave over time of a pitch in rad/s, which every recording has of its own size and phase."""

    pitch: float

    @property
    def own(self) -> bool:
        """See `Coordinate`."""
        return True

    def columns(self, index: int) -> Array:
        """See `Coordinate`."""
        turned = self.pitch * self.values[index]
        return np.stack([np.sin(turned), np.cos(turned)], axis=1)


@dataclass(frozen=True, slots=True)
class Springs(Coordinate):
    """Springs that are stretched by the way and yield at a reach (a stop operator), or relax (Maxwell's)."""

    step: float  # s from row to row
    relaxes: bool

    def columns(self, index: int) -> Array:
        """See `Coordinate`."""
        return self._relaxing(self.values[index]) if self.relaxes else self._yielding(self.values[index])

    def _yielding(self, travel: Array) -> Array:
        """Return how far springs of several reaches are stretched (n, b): each yields at its own."""
        ways = np.concatenate([np.diff(values) for values in self.values])
        reaches = float(np.sqrt(np.mean(ways**2))) / self.step * np.array(SPRING_MEMORIES_S)
        found = np.zeros((len(travel), len(reaches)))
        steps = np.diff(travel, prepend=travel[0])
        stretched = np.zeros(len(reaches))
        for row, step in enumerate(steps):
            stretched = np.minimum(np.maximum(stretched + step, -reaches), reaches)
            found[row] = stretched
        return found

    def _relaxing(self, travel: Array) -> Array:
        """Return how far springs behind dampers are stretched (n, b): each forgets its way over a time."""
        return _recalled(np.diff(travel, prepend=travel[0]), self.step, SPRING_MEMORIES_S)


@dataclass(frozen=True, slots=True)
class Warmth(Coordinate):
    """What is proportional to `values`, such as a speed, by how warm their squares have made it of late."""

    step: float  # s from row to row

    def columns(self, index: int) -> Array:
        """See `Coordinate`."""
        values = self.values[index]
        span = self.step * max(map(len, self.values))
        warm = _recalled(values**2, self.step, [share * span for share in WARM_SHARES])
        return values[:, None] * warm / (float(np.mean(values**2)) or 1.0)


@dataclass(frozen=True, slots=True)
class Interrupted(Coordinate):
    """A drive that fails now and then: `values` while it does, nothing else."""

    @property
    def searched(self) -> int:
        """See `Coordinate`: where each time begins and ends."""
        return 2 * sum(int(np.sum(np.diff((each != 0.0).astype(int), prepend=0) > 0)) for each in self.values)

    def columns(self, index: int) -> Array:
        """See `Coordinate`."""
        return -self.values[index][:, None]


def interrupted(name: str, drives: Sequence[Array], disturbances: Sequence[Array]) -> Interrupted | None:
    """Return where a drive (n,) of each recording fails, by the smoothed disturbance (n,) beside it; None if nowhere.

    There that takes away a share of the drive that it takes away nowhere else; of how much nothing need be known.
    """
    least = TELLING_DRIVE * max(float(np.max(np.abs(drive))) for drive in drives)
    telling = [np.abs(drive) > least for drive in drives]
    shares = [
        lost / np.where(tells, drive, np.inf) for lost, drive, tells in zip(disturbances, drives, telling, strict=True)
    ]
    every = np.concatenate([share[tells] for share, tells in zip(shares, telling, strict=True)])
    usual = float(np.median(every)) if len(every) else 0.0
    spread = float(np.median(np.abs(every - usual))) if len(every) else 0.0
    away = every[every < usual - RARE_DEVIATIONS * spread]
    if not len(away):
        return None
    half = usual + 0.5 * (float(np.median(away)) - usual)
    off = [(share < half) & tells for share, tells in zip(shares, telling, strict=True)]
    return Interrupted(f"{name}, now and then", tuple(d * each for d, each in zip(drives, off, strict=True)))


def _recalled(values: Array, step: float, times: Sequence[float]) -> Array:
    """Return the sum of values (n,), each of which is forgotten over several times (n, b)."""
    return np.stack([filtered(np.ones(1), np.array([1.0, -np.exp(-step / time)]), values) for time in times], axis=1)

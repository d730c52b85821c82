"""Compare the machines of a fleet: which one departs from the others, in which figure, and how sure that is.

The centre of a figure is its median, its spread 1.4826 times the median absolute deviation (MAD), both with the
recordings of one machine weighing as much as those of another; a few machines that are different move neither. Of the
spread, what the machines differ by is tau^2 = spread^2 - median(deviation^2). A figure departs by

    z = (value - centre) / sqrt(tau^2 + deviation^2)

with Student's t for its chance, at 0.37 (n - 1) degrees of freedom for n machines: the MAD of n normal values knows
their scatter as well as the standard deviation of 0.37 n does (Rousseeuw & Croux, JASA 88, 1993). All figures of all
recordings are tested together, with Holm's step-down rule: the chance that any machine of a fleet that is alike is
called different is at most 5 %.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtr

from firmloop.identify.normal import NORMAL_95
from firmloop.stages.fleet.member import Estimated, Member

Array = NDArray[np.float64]

FAMILY = 0.05  # chance of any false name in a fleet that is alike
FEWEST = 5  # machines; the spread of fewer is hardly known
EFFICIENCY = 0.37  # of the MAD beside the standard deviation, for normal values
TO_SIGMA = 1.4826  # MAD of normal values to their standard deviation


@dataclass(frozen=True, slots=True)
class Typical:
    """What a figure is in this fleet: median, and the standard deviation from machine to machine (`between`).

    Where `logarithmic`, `between` is that of the logarithm: 0.02 is 2 %.
    """

    figure: str
    unit: str
    logarithmic: bool
    centre: float
    between: float
    machines: int

    def distance(self, one: Estimated) -> tuple[float, float]:
        """Return value - centre and one standard deviation of the value, both as they are compared."""
        if not self.logarithmic:
            return one.value - self.centre, one.deviation or 0.0
        return math.log(one.value / self.centre), (one.deviation or 0.0) / one.value

    def z(self, one: Estimated) -> float:
        """Return by how many standard deviations of the fleet and of itself a value departs."""
        far, own = self.distance(one)
        return far / math.hypot(self.between, own)


@dataclass(frozen=True, slots=True)
class Departure:
    """A figure of a recording that is not like the others; `p` is its chance in a fleet that is alike, by Holm."""

    name: str  # of the recording
    figure: str
    value: Estimated
    typical: Typical
    z: float
    p: float

    @property
    def interval(self) -> tuple[float, float] | None:
        """The 95 % interval of the value; None where it has none."""
        half = None if self.value.deviation is None else NORMAL_95 * self.value.deviation
        return None if half is None else (self.value.value - half, self.value.value + half)


@dataclass(frozen=True, slots=True)
class Different:
    """A machine that is not like the others.

    `departures` are of its last recording that departs, the surest first; `effects` are what the diagnosis of that
    recording found and most of the fleet does not show; `since` is the first recording from which on all depart, None
    where the last one is like the others again; `recordings` is how many the machine has, `departing` which depart.
    """

    machine: str
    departures: tuple[Departure, ...]
    effects: Mapping[str, Mapping[str, object]]
    since: str | None
    departing: tuple[str, ...]
    recordings: int


@dataclass(frozen=True, slots=True)
class Compared:
    """What the fleet is like, who is different, and which effects most of its machines show."""

    typical: tuple[Typical, ...]
    different: tuple[Different, ...]
    shared: tuple[str, ...]
    not_compared: Mapping[str, str]  # figure -> why
    tests: int


def compare(members: Sequence[Member]) -> Compared:
    """Compare every recording with the fleet; `members` are machine by machine, in order of time."""
    used = [one for one in members if not one.refused]
    machines = {one.machine for one in used}
    if len(machines) < FEWEST:
        why = f"{len(machines)} machines could be used; to compare takes {FEWEST}"
        return Compared((), (), (), {"every figure": why}, 0)
    typical, without = _typical(used)
    tested = [(one, each, one.figures[each.figure]) for one in used for each in typical if each.figure in one.figures]
    family = _Family(EFFICIENCY * (len(machines) - 1), len(tested))
    z = np.array([each.z(value) for _, each, value in tested])
    found: dict[str, list[Departure]] = {}
    for (one, each, value), far, p in zip(tested, z, family.holm(z), strict=True):
        if p <= FAMILY:
            found.setdefault(one.name, []).append(Departure(one.name, each.figure, value, each, float(far), float(p)))
    shared = _shared(used, machines)
    return Compared(typical, tuple(_different(used, found, shared, family)), shared, without, family.tests)


@dataclass(frozen=True, slots=True)
class _Family:
    """All tests of a fleet: degrees of freedom of each, and how many there are."""

    freedom: float
    tests: int

    def alone(self, z: Array) -> Array:
        """Return the chance of each z by itself, to either side."""
        return np.asarray(2.0 * stdtr(self.freedom, -np.abs(z)))

    def holm(self, z: Array) -> Array:
        """Return the chances as they stand for all tests together (Holm, Scand. J. Statist. 6, 1979)."""
        chances = self.alone(z)
        order = np.argsort(chances, kind="stable")
        made = np.empty_like(chances)
        made[order] = np.minimum(np.maximum.accumulate(chances[order] * np.arange(self.tests, 0, -1)), 1.0)
        return made


def _typical(used: Sequence[Member]) -> tuple[tuple[Typical, ...], Mapping[str, str]]:
    """Return centre and spread of every figure that can be compared, and why the others cannot."""
    made, without = [], {}
    for figure in dict.fromkeys(name for one in used for name in one.figures):
        held = [(one.machine, one.figures[figure]) for one in used if figure in one.figures]
        recordings = Counter(machine for machine, _ in held)
        machines = len(recordings)
        logarithmic = all(one.logarithmic and one.value > 0.0 for _, one in held)
        values = np.array([math.log(one.value) if logarithmic else one.value for _, one in held])
        scale = np.array([one.value if logarithmic else 1.0 for _, one in held])
        own = np.array([one.deviation or 0.0 for _, one in held]) / scale
        weights = np.array([1.0 / recordings[machine] for machine, _ in held])
        centre = _median(values, weights)
        # A sample's own median is nearer to it than the truth is: n / (n - 0.8), of the same paper.
        spread = TO_SIGMA * _median(np.abs(values - centre), weights) * machines / (machines - 0.8)
        between = math.sqrt(max(spread**2 - _median(own**2, weights), 0.0))
        if machines < FEWEST:
            without[figure] = f"{machines} machines have it; to compare takes {FEWEST}"
        elif between == 0.0 and not np.all(own):
            without[figure] = "it is the same in more than half of the recordings, and its uncertainty is not known"
        else:
            middle = math.exp(centre) if logarithmic else centre
            made.append(Typical(figure, held[0][1].unit, logarithmic, middle, between, machines))
    return tuple(made), without


def _median(values: Array, weights: Array) -> float:
    """Return the median where some values weigh more: half of the weight lies below it."""
    order = np.argsort(values, kind="stable")
    ranked, below = values[order], np.cumsum(weights[order])
    half = 0.5 * below[-1]
    first = int(np.searchsorted(below, half * (1 - 1e-12)))
    # Where exactly half of the weight lies on each side, it is the middle of the two neighbours.
    even = math.isclose(below[first], half, rel_tol=1e-12) and first + 1 < len(ranked)
    return float(0.5 * (ranked[first] + ranked[first + 1]) if even else ranked[first])


def _shared(used: Sequence[Member], machines: set[str]) -> tuple[str, ...]:
    """Return the effects that more than half of the machines show: they belong to the type."""
    showing: dict[str, set[str]] = {}
    for one in used:
        for name in one.effects:
            showing.setdefault(name, set()).add(one.machine)
    return tuple(sorted(name for name, found in showing.items() if 2 * len(found) > len(machines)))


def _different(
    used: Sequence[Member], found: Mapping[str, Sequence[Departure]], shared: Sequence[str], family: _Family
) -> Iterator[Different]:
    for machine in dict.fromkeys(one.machine for one in used):
        own = [one for one in used if one.machine == machine]
        departing = tuple(one.name for one in own if one.name in found)
        if not departing:
            continue
        last = next(one for one in own if one.name == departing[-1])
        calm = [k for k, one in enumerate(own) if one.name not in found]
        since = own[calm[-1] + 1 if calm else 0].name if own[-1].name in found else None
        effects = {name: each for name, each in last.effects.items() if name not in shared}
        shown = sorted(found[last.name], key=lambda each: -abs(each.z))
        if effects and len(effects) == len(last.effects):
            shown = [other for each in shown if (other := _beside(each, last, family)) is not None]
        yield Different(machine, tuple(shown), effects, since, departing, len(own))


def _beside(departure: Departure, member: Member, family: _Family) -> Departure | None:
    """Return what is left of a departure beside the effects found: a figure may have stood for what was missing."""
    value = member.beside.get(departure.figure)
    if value is None:  # what the plant left over: the effects explain it
        return None
    z = departure.typical.z(value)
    p = family.tests * float(family.alone(np.array([z]))[0])
    return replace(departure, value=value, z=z, p=p) if p <= FAMILY else None

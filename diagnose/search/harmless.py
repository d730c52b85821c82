"""Do no harm: write no plant whose free simulation is further off than that of the plain refit, on any output."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from firmloop.diagnose.model.candidate import believable, by_simulation_error, rms_of
from firmloop.diagnose.model.fit import Fitted, fit
from firmloop.diagnose.model.hypothesis import Problem
from firmloop.diagnose.policy import CLOSER_RMS, EXCHANGE_PATIENCE, SAME_RMS, STEPS_OF_A_FIT
from firmloop.diagnose.search.exchange import as_large, exchanged, mistaken
from firmloop.diagnose.search.found import Search
from firmloop.diagnose.search.improved import improved_plant
from firmloop.identify.error import IdentifyError
from firmloop.identify.fitting.fit import fit as identified
from firmloop.identify.fitting.noise import white
from firmloop.identify.fitting.own_values import fit_start, own_start, placed_start
from firmloop.identify.plants.plant import Plant
from firmloop.identify.recordings.conditioning import NONE
from firmloop.identify.recordings.recording import Recording
from firmloop.identify.signal import Signal
from firmloop.identify.simulation.simulate import constants_of, measured, simulate

Array = NDArray[np.float64]
Start = Callable[[Plant, Recording, Array], Array]


def as_recorded(plant: Plant, recording: Recording, constants: Array) -> Array:
    """Return the initial state (n,) from which the plant meets all readings of a recording best."""
    return fit_start(plant, recording, constants, NONE)


TOLD: tuple[Start, ...] = (placed_start, as_recorded)  # by all readings, so that no noise of one of them decides
FIRST: tuple[Start, ...] = (own_start, as_recorded)  # as `firmloop simulate` begins, without and with --fit-initial
EVERYWHERE: tuple[Start, ...] = (own_start, *TOLD)


def plain_refit(found: Search, plant: Plant, train: Sequence[Recording]) -> Plant:
    """Return the plant that `identify` would write of recordings; the search's where it would not, or that diverges."""
    other = improved_plant(found, found.nominal)
    if not np.all(np.isfinite(Simulations(other, train).rms())):
        return other
    whole = all(
        one.columns is seen.columns and one.time is seen.time and one.hold == seen.hold
        for one, seen in zip(train, found.problem.train, strict=True)
    )
    return (found.refit if whole else as_identified(plant, train)) or other


def as_identified(plant: Plant, train: Sequence[Recording]) -> Plant | None:
    """Return the plant that `identify` would write; None where it would refuse the recordings."""
    try:
        return identified(plant, train, (), NONE).plant
    except IdentifyError:
        return None


@dataclass(frozen=True, slots=True)
class Simulations:
    """A plant simulated freely, its input alone known, beside recordings; what was simulated once is kept."""

    plant: Plant
    recordings: Sequence[Recording]
    known: dict[Start, tuple[tuple[Array | None, ...], Array]] = field(default_factory=dict)

    def starts(self, begin: Start) -> tuple[Array | None, ...]:
        """Return the initial state (n,) of each recording; None where it cannot be simulated from one."""
        return self._made(begin)[0]

    def rms(self, begin: Start = own_start) -> Array:
        """Return the rms (recordings, r) of measured - simulated; infinite if it fails.

        From rest, as `firmloop simulate` does it, unless it is to `begin` elsewhere.
        """
        return self._made(begin)[1]

    def overall_rms(self, begin: Start = own_start) -> Array:
        """Return the rms (r,) of all recordings together; infinite where one fails."""
        weights = np.array([len(each.time) for each in self.recordings], dtype=np.float64)
        return np.asarray(np.sqrt(weights @ self.rms(begin) ** 2 / weights.sum()))

    def from_starts(self, starts: Sequence[Start] = TOLD) -> Array:
        """Return the rms (starts, recordings, r) of simulations that begin in several ways.

        At rest and where the readings say, as a recording may begin in motion. At rest, too, a place is where all its
        readings say: the noise of the first alone is no property of a plant.
        """
        return np.stack([self.rms(begin) for begin in starts])

    def _made(self, begin: Start) -> tuple[tuple[Array | None, ...], Array]:
        if begin not in self.known:
            constants, starts = constants_of(self.plant), list[Array | None]([None] * len(self.recordings))
            rms = np.full((len(self.recordings), len(self.plant.outputs)), np.inf)
            for k, recording in enumerate(self.recordings):
                try:
                    start = begin(self.plant, recording, constants)
                    left = measured(self.plant, recording) - simulate(self.plant, recording, start)
                except IdentifyError:
                    continue
                starts[k], rms[k] = start, np.sqrt(np.mean(left**2, axis=0))
            self.known[begin] = (tuple(starts), rms)
        return self.known[begin]


def harmless(written: Simulations, refit: Simulations, starts: Sequence[Start] = EVERYWHERE) -> bool:
    """Tell whether a plant simulates every output of every recording no worse than the refit, wherever it begins."""
    return not harmed(written, refit, starts)


@dataclass(frozen=True, slots=True)
class Harm:
    """An output of a recording that a plant simulates worse than the refit; rms in its unit, infinite if it fails."""

    source: str
    output: Signal
    begun: str
    refit: float
    written: float


def harmed(written: Simulations, refit: Simulations, starts: Sequence[Start] = EVERYWHERE) -> tuple[Harm, ...]:
    """Return what a plant simulates worse than the refit, of each output of a recording where it is the worst."""
    ours, plain = written.from_starts(starts), refit.from_starts(starts)
    worse, found = _worse(ours, plain), []
    for k, recording in enumerate(written.recordings):
        for column, signal in enumerate(written.plant.outputs):
            begins = np.flatnonzero(worse[:, k, column])
            if not len(begins):
                continue
            with np.errstate(divide="ignore"):  # of a refit that meets all
                more = ours[begins, k, column] / plain[begins, k, column]
            at = int(begins[np.argmax(more)])
            begun = "begun where its readings say" if starts[at] is as_recorded else "from rest"
            misses = (float(each[at, k, column]) for each in (plain, ours))
            found.append(Harm(recording.source, signal, begun, *misses))
    return tuple(found)


def no_worse(rms: Array, refit: Array) -> bool:
    """Tell whether a plant's rms (starts, recordings, r) is no more than the refit's, of any output of any recording.

    The last start is where readings say. A recording that the refit simulates far nearer from there than from rest
    begins in motion: from rest it tells nothing.
    """
    return not np.any(_worse(rms, refit))


def _worse(rms: Array, refit: Array) -> NDArray[np.bool_]:
    """Tell what of all starts, recordings and outputs a plant leaves more of than the refit, see `no_worse`."""
    moving = np.any(CLOSER_RMS * refit > refit[-1], axis=2, keepdims=True)
    return np.asarray(~((rms <= SAME_RMS * refit) | moving))


def same_function(problem: Problem, fitted: Fitted) -> tuple[Fitted, ...]:
    """Return the explanations with one effect exchanged for what it may be mistaken for that simulate just as well."""
    left = rms_of(fitted.residuals)
    sizes = [white(float(size)) for size in left]
    found, begun = [], problem.engine.steps
    for gone, come in mistaken(problem, fitted):
        if problem.engine.steps - begun > EXCHANGE_PATIENCE:
            break
        first = next(iter(problem.starts[come.label]), None)
        start = None if first is None else as_large(problem, fitted, gone, come, first)
        if start is None:
            continue
        terms, point = exchanged(fitted, gone, come, start)
        other = by_simulation_error(problem, fit(problem, problem.train, terms, point, sizes, STEPS_OF_A_FIT))
        if believable(other) and np.all(rms_of(other.residuals) <= SAME_RMS * left):
            found.append(other)
    return tuple(found)


def simulated_figures(
    parts: Mapping[str, Mapping[str, Simulations]],
) -> dict[str, dict[str, dict[str, float]]]:
    """Return {role: {output: {plant: rms}}} of free simulations, in the outputs' units; not of those that diverge.

    `parts` are the plants by their names, by role.
    """
    found: dict[str, dict[str, dict[str, float]]] = {}
    for role, plants in parts.items():
        for name, each in plants.items():
            for signal, size in zip(each.plant.outputs, each.overall_rms(), strict=True):
                if np.isfinite(size):
                    found.setdefault(role, {}).setdefault(signal.name, {})[name] = float(size)
    return found


def held(recordings: Sequence[Recording], hold: str) -> tuple[Recording, ...]:
    """Return the recordings with what their input did between rows."""
    return tuple(replace(each, hold=hold) for each in recordings)

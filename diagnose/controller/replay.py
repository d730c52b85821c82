"""Cut the loop at its recorded wires: play the controller again on what it was given, and hold it against its command.

What the controller's own arithmetic does not answer bit for bit, within the digits of the recording, is a fault of the
firmware: another gain, limit, sign or scale, a late sample, another period. The plant half is simulated from the
recorded command, so neither half can hide the other's mismatch.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from firmloop.diagnose.controller.faults import Fault, Guess, as_given, faults, gains, played
from firmloop.diagnose.controller.fit import Match, felt, match, spread_of
from firmloop.diagnose.controller.record import LoopRecord, loop_of
from firmloop.diagnose.policy import (
    AGREES,
    COMMAND_CORRELATION,
    COMMAND_NOISE,
    DECISIVE_SHARE,
    FAULTS_BESIDE,
    FINAL_FAULTS,
    FIRST_TURNS,
    OTHER_CONTROLLER,
    OTHER_GAINS,
    PERIOD_SHARE,
    PROMISING_SHARE,
    REPLAY_TURNS,
    SAME_MISFIT,
    SIGNIFICANT_GAIN,
    TRIFLING_GAIN,
)
from firmloop.identify.plants.plant import Plant
from firmloop.identify.recordings.recording import Recording
from firmloop.verify.replay import Controller, play_exactly

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Blame:
    """One fault of the controller half, fitted; `deviation` is one standard deviation of its figure, if it was."""

    fault: Fault
    figure: float
    deviation: float | None
    match: Match


@dataclass(frozen=True, slots=True)
class Cut:
    """What the replay of a controller says.

    `loops` is how many recordings were replayed and `samples` how many samples, of which `same` were answered as
    recorded, within the digits; `blames` are the faults that explain the rest, `others` what would explain it as well.
    `unexplained`: the command differs in a way that none does. `notes` say what could not be replayed.
    """

    loops: int
    samples: int
    same: int
    worst: float  # largest difference, in the command's unit
    blames: tuple[Blame, ...]
    others: tuple[Blame, ...]
    unexplained: bool
    command: str
    unit: str
    spans: tuple[tuple[float, float], ...]  # s, where the difference is largest
    left: float  # share of the mismatch's rms that remains
    notes: tuple[str, ...]

    @property
    def guilty(self) -> bool:
        """Whether the controller half differs from the project's."""
        return bool(self.blames) or self.unexplained


def cut(plant: Plant, controller: Controller, recordings: Sequence[Recording]) -> Cut | None:
    """Replay the controller on every recording that holds a reference and a command; None where there is none."""
    made = [loop_of(plant, controller, recording) for recording in recordings]
    notes = [each for each in made if isinstance(each, str) and each]
    loops = [each for each in made if isinstance(each, LoopRecord)]
    seen = [(loop, found) for loop in loops if (found := _seen(controller, loop, notes)) is not None]
    if not seen:
        return _nothing(notes) if notes else None
    loop, (base, spread, wide) = max(seen, key=lambda each: each[1][0].misfit)
    same = sum(_same(found[0], found[1]) for _, found in seen)
    samples = sum(int(np.isfinite(found[0].left).sum()) for _, found in seen)
    silent = Cut(
        len(seen), samples, same, float(np.nanmax(np.abs(base.left))), (), (), False, loop.command_name,
        controller.output.unit, _spans(loop, base.left / spread), 1.0, tuple(notes),
    )  # fmt: skip
    given = as_given(controller, loop)
    off = given.stride * loop.row_s / controller.period - 1.0
    if base.misfit <= AGREES:
        if abs(off) > PERIOD_SHARE:
            return replace(silent, blames=(_stepping(controller, loop, base),))
        return silent
    chain, others = _search(controller, loop, base, spread)
    left = (chain[0].match.misfit / base.misfit) ** 2 if chain else 1.0
    proven = bool(chain) and (
        chain[0].match.misfit <= AGREES or (left <= DECISIVE_SHARE and _noisy(loop, chain[0].match))
    )
    gains_only = [each for each in chain if each.fault.name == "controller_gain"]
    if proven and (len(gains_only) > OTHER_GAINS or all(_tuned(controller, each.fault) for each in chain)):
        figures = ", ".join(f"{each.fault.what} = {each.figure:.5g}" for each in gains_only)
        told = f"{loop.source} was recorded with another controller than the project's: {figures}"
        return replace(silent, notes=(*notes, told))
    if proven:
        return replace(silent, blames=chain, others=others, left=float(np.sqrt(left)))
    if float(np.sqrt(np.nanmean((base.left / wide) ** 2))) <= AGREES:
        return silent
    if loop.row_s > 1.5 * controller.period:
        told = f"{loop.source} has a row every {loop.row_s:.4g} s, the controller steps every {controller.period:g} s"
        return replace(silent, notes=(*notes, f"{told}: its half cannot be replayed; record every step"))
    return _unexplained(silent, loop, base)


def _tuned(controller: Controller, fault: Fault) -> bool:
    """Whether a fault is but a gain that a rule has found: nobody said that the firmware has it."""
    return fault.name == "controller_gain" and fault.what in controller.tuned


def _nothing(notes: Sequence[str]) -> Cut:
    return Cut(0, 0, 0, 0.0, (), (), False, "", "", (), 1.0, tuple(notes))


def _seen(controller: Controller, loop: LoopRecord, notes: list[str]) -> tuple[Match, Array, Array] | None:
    """Replay as given, from init() or, where that does not fit, from the first state that fits best.

    Returns the match, and what rounding leaves by the digits and by the sensors' steps.
    """
    given, start = as_given(controller, loop), controller.start
    real = played(controller, loop, given, start)
    if real is None:
        notes.append(f"{loop.source}: the controller cannot be replayed")
        return None
    rest = _exact(controller, loop, given, start)
    rounding = float(np.sqrt(np.nanmean((loop.command - rest - real) ** 2)))
    spread, wide = (
        spread_of(controller, loop, given, start, written, rounding) for written in (loop.digits, loop.steps)
    )
    found = _rated(loop, given, start, rest, spread)
    if found.misfit <= AGREES:
        return found, spread, wide
    later = controller.running
    moved = match(controller, loop, spread, lambda _: given, (), later, felt(controller, loop, given, later))
    if moved is not None and moved.misfit <= 0.9 * found.misfit:
        found = _rated(loop, given, moved.start, _exact(controller, loop, given, moved.start), spread)
    return found, spread, wide


def _exact(controller: Controller, loop: LoopRecord, given: Guess, start: Array) -> Array:
    """Return recorded - replayed (n,), bit for bit."""
    rows = np.arange(given.phase, len(loop.time), given.stride)
    answer = play_exactly(controller, loop.inputs[rows], start)
    whole = np.full(len(loop.time), np.nan)
    whole[given.phase :] = np.repeat(answer, given.stride)[: len(whole) - given.phase]
    left: Array = loop.command - whole
    left[: given.stride] = np.nan
    return left


def _rated(loop: LoopRecord, given: Guess, start: Array, left: Array, spread: Array) -> Match:
    misfit = float(np.sqrt(np.nanmean((left / spread) ** 2)))
    return Match(given, (), (), start, left, misfit, given.stride * loop.row_s)


def _same(found: Match, spread: Array) -> int:
    return int(np.sum(np.abs(found.left) <= AGREES * spread))


def _stepping(controller: Controller, loop: LoopRecord, base: Match) -> Blame:
    """Blame the period where the arithmetic is right: the figures of one period, run at another."""
    fault = Fault("controller_period", "steps", "s", controller.period, base.sample_s, False, lambda guess, _: guess)
    return Blame(fault, base.sample_s, None, base)


def _search(
    controller: Controller, loop: LoopRecord, base: Match, spread: Array
) -> tuple[tuple[Blame, ...], tuple[Blame, ...]]:
    """Return the faults that explain the command, and others of which each would do as well.

    Single faults first; then every gain at once, beside each of the few that help most without a fitted figure.
    """
    # A first state that was fitted without the fault is a bad one: the recording may begin with init() or later.
    begins = [base.start, controller.start, controller.running]
    bases = [replace(base, start=np.array(begin)) for begin in sorted({tuple(begin) for begin in begins})]
    quick = [
        (found, at)
        for fault in faults(controller, loop, base.guess)
        for at in bases
        if (found := _try(controller, loop, at, spread, fault, ())) is not None
    ]
    quick.sort(key=lambda each: each[0].match.misfit)
    ranked = [found for found, _ in quick]
    tried = [
        _try(controller, loop, at, spread, found.fault, felt(controller, loop, base.guess, at.start))
        for found, at in quick[:FINAL_FAULTS]
    ]
    single = [each for each in tried if each is not None]
    if not single:
        return (), ()
    chosen = _simplest(single)
    others = tuple(
        each
        for each in single
        if each.match.misfit <= SAME_MISFIT * max(chosen.match.misfit, 1.0) and _kind(each) != _kind(chosen)
    )
    if chosen.match.misfit <= AGREES:
        return (chosen,), _distinct(others)
    fixed = _distinct([each for each in ranked if not each.fault.fitted])[:FAULTS_BESIDE]
    at = quick[0][1]
    states = felt(controller, loop, base.guess, at.start)
    several = [
        _several(controller, loop, at, spread, beside, alone, states)
        for beside in (None, *fixed)
        for alone in ((True, False) if controller.defaults else (True,))
    ]
    every = [each for each in several if each]
    best = min(every, key=lambda each: (len(each), each[0].match.misfit), default=(chosen,))
    better = best[0].match.misfit <= AGREES < chosen.match.misfit
    return (best, ()) if better else ((chosen,), _distinct(others))


def _try(
    controller: Controller, loop: LoopRecord, base: Match, spread: Array, fault: Fault, states: Sequence[int]
) -> Blame | None:
    if fault.fitted:
        found = match(
            controller, loop, spread, lambda x: fault.apply(base.guess, x[0]), (fault.figure,), base.start, states
        )
    else:
        found = match(controller, loop, spread, lambda _: fault.apply(base.guess, fault.figure), (), base.start, states)
    if found is None:
        return None
    return Blame(fault, found.figures[0], found.deviations[0], found) if fault.fitted else Blame(
        fault, fault.figure, None, found
    )  # fmt: skip


def _several(
    controller: Controller,
    loop: LoopRecord,
    base: Match,
    spread: Array,
    beside: Blame | None,
    alone: bool,
    states: Sequence[int],
) -> tuple[Blame, ...]:
    """Fit all gains at once beside one other fault; then again those alone that came out as another figure."""
    chosen = gains(controller, alone)
    start = base.guess if beside is None else beside.fault.apply(base.guess, beside.figure)
    found: Match | None = None
    for turns in (FIRST_TURNS, REPLAY_TURNS, REPLAY_TURNS):

        def applied(figures: Sequence[float], chosen: Sequence[Fault] = chosen) -> Guess:
            guess = start
            for fault, figure in zip(chosen, figures, strict=True):
                guess = fault.apply(guess, figure)
            return guess

        figures = tuple(fault.figure for fault in chosen)
        found = match(controller, loop, spread, applied, figures, base.start, states, turns)
        if found is None or found.misfit > (PROMISING_SHARE * base.misfit if turns == FIRST_TURNS else AGREES):
            return ()
        if turns == FIRST_TURNS and found.misfit > AGREES:
            continue
        moved = [
            abs(figure - fault.given) > max(SIGNIFICANT_GAIN * deviation, TRIFLING_GAIN * abs(fault.given))
            for fault, figure, deviation in zip(chosen, found.figures, found.deviations, strict=True)
        ]
        chosen, kept = tuple(f for f, is_moved in zip(chosen, moved, strict=True) if is_moved), len(chosen)
        if len(chosen) in (0, kept):
            break
    if found is None or len(found.figures) != len(chosen):
        return ()
    blames = [
        Blame(fault, figure, deviation, found)
        for fault, figure, deviation in zip(chosen, found.figures, found.deviations, strict=True)
    ]
    return (*(() if beside is None else (Blame(beside.fault, beside.figure, None, found),)), *blames)


def _simplest(tried: Sequence[Blame]) -> Blame:
    """Return the best; of those that are as good, one without a fitted figure, else the first."""
    least = SAME_MISFIT * max(min(each.match.misfit for each in tried), 1.0)
    good = [each for each in tried if each.match.misfit <= least]
    whole = [each for each in good if not each.fault.fitted]
    return min(whole or good, key=lambda each: each.match.misfit)


def _kind(blame: Blame) -> tuple[str, str]:
    """Return what a fault is about; a sign is a scale of -1."""
    name = blame.fault.name
    return ("controller_scale" if name == "controller_sign" else name, blame.fault.what)


def _distinct(blames: Sequence[Blame]) -> tuple[Blame, ...]:
    found: dict[tuple[str, str], Blame] = {}
    for each in blames:
        found.setdefault(_kind(each), each)
    return tuple(found.values())


def _unexplained(silent: Cut, loop: LoopRecord, base: Match) -> Cut:
    """Say what a mismatch is that no fault explains: noise, another controller, or something unknown."""
    if _noisy(loop, base):
        return silent
    if _share(loop, base) > OTHER_CONTROLLER:
        said = (
            f"{loop.source}: the recorded {loop.command_name} is not what this project's controller answers, nor is it "
            "with any one figure changed; it was recorded with another controller, and the controller half says nothing"
        )
        return replace(silent, notes=(*silent.notes, said))
    return replace(silent, unexplained=True)


def _share(loop: LoopRecord, found: Match) -> float:
    return float(np.nanstd(found.left)) / max(float(np.std(loop.command)), 1e-300)


def _noisy(loop: LoopRecord, found: Match) -> bool:
    """Whether what is left is little, and so little correlated that it may be the noise of a logger."""
    left = found.left[np.isfinite(found.left)]
    centred = left - left.mean()
    alike = float(centred[1:] @ centred[:-1]) / max(float(centred @ centred), 1e-300)
    return _share(loop, found) <= COMMAND_NOISE and alike < COMMAND_CORRELATION


def _spans(loop: LoopRecord, left: Array) -> tuple[tuple[float, float], ...]:
    """Return the stretch in which the difference is largest, s."""
    size = np.nan_to_num(np.abs(left))
    peak = int(np.argmax(size))
    low = high = peak
    while low > 0 and size[low - 1] > 0.3 * size[peak]:
        low -= 1
    while high + 1 < len(size) and size[high + 1] > 0.3 * size[peak]:
        high += 1
    return ((float(loop.time[low]), float(loop.time[high])),)

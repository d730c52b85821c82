"""The faults that a controller half can have: each a Guess of how it was run when the recording was made."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from firmloop.diagnose.controller.record import LoopRecord
from firmloop.diagnose.policy import LIMITED_ROWS, MOST_LATE_SAMPLES, NO_LIMIT
from firmloop.identify.units import unit_of
from firmloop.verify.replay import WINDUP, Controller, play, play_unlimited

Array = NDArray[np.float64]
Path = tuple[str | int, ...]

_LIMITS = ("u_min", "u_max")


@dataclass(frozen=True, slots=True)
class Guess:
    """How a controller was run: with which figures, on which of the recording's rows, between which wires.

    `factors` multiply the inputs and `gain` the output; `late` and `lates` are samples by which the output and each
    input come late; `limits` is the range of the output, None as in the project; `leaky`: the output does not keep to
    its limits although the controller believes that it does.
    """

    table: Mapping[str, object]
    period: float  # s, for which the controller was computed
    stride: int  # rows
    phase: int
    factors: tuple[float, ...]
    lates: tuple[int, ...]
    gain: float = 1.0
    late: int = 0
    limits: tuple[float, float] | None = None
    leaky: bool = False


@dataclass(frozen=True, slots=True)
class Fault:
    """One way in which a controller may differ from the project's.

    `name` is what a diagnosis calls it, `what` the gain, wire or limit. `apply` makes the guess with a figure; `given`
    is the project's figure. `fitted`: the figure is to be found, from `figure` on.
    """

    name: str
    what: str
    unit: str
    given: float
    figure: float
    fitted: bool
    apply: Callable[[Guess, float], Guess]


def as_given(controller: Controller, loop: LoopRecord) -> Guess:
    """Return the guess that everything is as the project says."""
    stride = max(1, round(controller.period / loop.row_s))
    count = len(controller.inputs)
    return Guess(
        controller.table, controller.period, stride, loop.phase % stride, (1.0,) * count, (0,) * count
    )  # fmt: skip


def played(controller: Controller, loop: LoopRecord, guess: Guess, start: Array) -> Array | None:
    """Return the command (n,) of a guess from state `start`, NaN where it says nothing; None where it cannot be."""
    changed = guess.table is not controller.table or guess.period != controller.period or guess.limits is not None
    law = controller.rebuild(guess.table, guess.period, guess.limits) if changed else controller.law
    if law is None or len(law.start) != len(start):
        return None
    rows = np.arange(guess.phase, len(loop.time), guess.stride)
    given = loop.inputs[rows] * np.asarray(guess.factors)
    for index, late in enumerate(guess.lates):
        given[:, index] = given[np.maximum(np.arange(len(rows)) - late, 0), index]
    answer = play_unlimited(law, given, start) if guess.leaky else play(law, given, start)
    if answer is None:
        return None
    silent = max(guess.late, *guess.lates)
    shifted = guess.gain * np.concatenate([np.full(guess.late, answer[0]), answer])[: len(rows)]
    shifted[:silent] = np.nan
    whole = np.full(len(loop.time), np.nan)
    held = np.repeat(shifted, guess.stride)[: len(whole) - guess.phase]
    whole[guess.phase :] = held
    return whole


def faults(controller: Controller, loop: LoopRecord, base: Guess) -> Iterator[Fault]:
    """List every single fault."""
    yield from gains(controller, True)
    yield from gains(controller, False) if controller.defaults else ()
    yield from _limits(controller, loop, base)
    yield from _lates(controller)
    yield from _periods(controller, loop, base)
    yield from _wires(controller)
    yield from _manners(base)


def gains(controller: Controller, alone: bool) -> tuple[Fault, ...]:
    """List a fault for every number of [controller]; alone, or with those that follow from it."""
    table = controller.table
    if not alone:
        table = {key: value for key, value in table.items() if key not in controller.defaults}
    found = []
    for path, value in _leaves(table, ()):
        if value == 0.0 or path[0] in _LIMITS:
            continue

        def changed(guess: Guess, figure: float, path: Path = path) -> Guess:
            own = guess.table if alone else {k: v for k, v in guess.table.items() if k not in controller.defaults}
            return replace(guess, table=_changed(own, path, figure))

        name = str(path[0]) + "".join(f"[{index}]" for index in path[1:])
        found.append(Fault("controller_gain", name, unit_of(name), value, value, True, changed))
    return tuple(found)


def _leaves(value: object, path: Path) -> Iterator[tuple[Path, float]]:
    """List every number of a table with its place."""
    if isinstance(value, bool):
        return
    if isinstance(value, int | float):
        yield path, float(value)
    elif isinstance(value, Mapping):
        for key, inner in value.items():
            yield from _leaves(inner, (*path, str(key)))
    elif isinstance(value, list | tuple):
        for index, inner in enumerate(value):
            yield from _leaves(inner, (*path, index))


def _changed(value: object, path: Path, figure: float) -> Mapping[str, object]:
    """Return a copy of a table with another number at one place."""

    def inner(part: object, rest: Path) -> object:
        if not rest:
            return figure
        if isinstance(part, Mapping):
            return {key: inner(each, rest[1:]) if key == rest[0] else each for key, each in part.items()}
        assert isinstance(part, list | tuple)
        return [inner(each, rest[1:]) if index == rest[0] else each for index, each in enumerate(part)]

    made = inner(value, path)
    assert isinstance(made, Mapping)
    return made


def _limits(controller: Controller, loop: LoopRecord, base: Guess) -> Iterator[Fault]:
    """Try no limits at all, limits that the output alone does not keep, and those that the command seems to have."""
    low, high = (
        float(end) if isinstance(end := controller.table.get(key), int | float) else edge
        for key, edge in zip(_LIMITS, (controller.output.low, controller.output.high), strict=True)
    )
    width = high - low
    lowest, highest = float(loop.command.min()), float(loop.command.max())

    def limited(guess: Guess, ends: tuple[float, float]) -> Guess:
        # In a controller of several outputs the first alone has a wire; such limits are lists, and stay.
        keys = {
            key: end for key, end in zip(_LIMITS, ends, strict=True) if isinstance(guess.table.get(key), int | float)
        }
        return replace(guess, table={**guess.table, **keys}, limits=ends)

    far = (low - NO_LIMIT * width, high + NO_LIMIT * width)
    yield Fault("controller_saturation", "none", controller.output.unit, high, highest, False,
                lambda guess, _: limited(guess, far))  # fmt: skip
    yield Fault("controller_saturation", "output alone", controller.output.unit, high, highest, False,
                lambda guess, _: replace(guess, leaky=True))  # fmt: skip
    flat = [int(np.sum(loop.command == end)) >= LIMITED_ROWS for end in (lowest, highest)]
    if any(flat):
        ends = (lowest if flat[0] else low, highest if flat[1] else high)
        if flat == [False, True] and lowest >= -highest:
            ends = (-highest, highest)  # one side was never reached; limits are mostly symmetric
        elif flat == [True, False] and highest <= -lowest:
            ends = (lowest, -lowest)
        yield Fault("controller_saturation", "other", controller.output.unit, high, ends[1], False,
                    lambda guess, _: limited(guess, ends))  # fmt: skip


def _lates(controller: Controller) -> Iterator[Fault]:
    for late in range(1, MOST_LATE_SAMPLES + 1):
        yield Fault("controller_delay", "command", "", 0.0, float(late), False,
                    lambda guess, figure: replace(guess, late=int(figure)))  # fmt: skip
        for index, signal in enumerate(controller.inputs):

            def later(guess: Guess, figure: float, index: int = index) -> Guess:
                return replace(guess, lates=tuple(int(figure) if k == index else d for k, d in enumerate(guess.lates)))

            yield Fault("controller_delay", signal.name, "", 0.0, float(late), False, later)


def _periods(controller: Controller, loop: LoopRecord, base: Guess) -> Iterator[Fault]:
    """Try the rows at which the command is seen to change, with figures for the project's period and for that one."""
    real = loop.stride * loop.row_s
    if loop.stride != base.stride:
        yield Fault("controller_period", "steps", "s", controller.period, real, False,
                    lambda guess, _: replace(guess, stride=loop.stride, phase=loop.phase))  # fmt: skip
    yield Fault("controller_period", "figures", "s", controller.period, real, False,
                lambda guess, _: replace(guess, stride=loop.stride, phase=loop.phase, period=real))  # fmt: skip
    for times in (0.1, 0.5, 2.0, 10.0):
        # Figures that were computed for another period than the one in which the firmware steps.
        yield Fault("controller_period", "computed for", "s", controller.period, times * controller.period, False,
                    lambda guess, figure: replace(guess, period=figure))  # fmt: skip


def _wires(controller: Controller) -> Iterator[Fault]:
    for index, signal in enumerate(controller.inputs):

        def scaled(guess: Guess, figure: float, index: int = index) -> Guess:
            return replace(guess, factors=tuple(figure if k == index else f for k, f in enumerate(guess.factors)))

        yield Fault("controller_sign", signal.name, "", 1.0, -1.0, False, scaled)
        yield Fault("controller_scale", signal.name, "", 1.0, 1.0, True, scaled)
    yield Fault("controller_sign", "output", "", 1.0, -1.0, False, lambda guess, figure: replace(guess, gain=figure))
    yield Fault("controller_scale", "output", "", 1.0, 1.0, True, lambda guess, figure: replace(guess, gain=figure))


def _manners(base: Guess) -> Iterator[Fault]:
    """Try other words in place of those of the table, and its optional parts away."""
    usual = base.table.get("anti_windup", WINDUP[0])
    for manner in WINDUP:
        if manner != usual:

            def other(guess: Guess, figure: float, manner: str = manner) -> Guess:
                return replace(guess, table={**guess.table, "anti_windup": manner})

            yield Fault("controller_anti_windup", manner, "", 0.0, 0.0, False, other)
    if "feedforward" in base.table:
        yield Fault(
            "controller_feedforward", "feedforward", "", 1.0, 0.0, False,
            lambda guess, _: replace(guess, table={k: v for k, v in guess.table.items() if k != "feedforward"}),
        )  # fmt: skip

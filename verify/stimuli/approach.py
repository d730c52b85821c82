"""Samples that bring a value to the edge of a limit that it reaches only after many of them.

Inputs that drive the controller hard are followed until a value crosses its limit. The way there is taken again by many
lanes that differ in their last bits, and the sample that crosses is moved to the very edge (`verify/stimuli/edges.py`).
Of each limit lanes are kept on it, next to it above and next to it below: three or more, as there is room.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from firmloop.quantize.program import Program
from firmloop.verify.reference import Machine, Raw, start_state, working_type
from firmloop.verify.scaling import to_raw
from firmloop.verify.stimuli.edges import (
    Array,
    Edge,
    limits,
    nearest,
    row,
    short,
    spans_of,
    state_behind,
    to_an_edge,
)

TRIED = 512  # lanes for each limit
TRIED_SHORT = 8192  # where a unit of an input moves a value by hundreds of its own
VARIED = 2  # samples before the edge that differ from lane to lane,
AMOUNT = 0.01  # by so much of an input's range
WAIT = 3  # samples that the last input which moves a value may lie before it
MOST = 32  # lanes on each side of a limit: where roundings hide a difference of one unit, some lane shows it
SHOWN = 2  # samples after the edge, which show what it left


@dataclass(frozen=True, slots=True)
class Crossing:
    """A value passes `edge` in sample `at` of the inputs `drive` (length, m), in their units."""

    edge: Edge
    at: int
    drive: Array


def approaches(program: Program, random: np.random.Generator, drives: Array, samples: int) -> Raw | None:
    """Return inputs (lanes, length, m) of about `samples` samples; None where no limit is crossed late.

    Parameters
    ----------
    drives
        inputs (lanes, length, m) in their units, to look for crossings in.
    """
    found = crossings(program, drives)
    kept: list[Crossing] = []
    for crossing in (found[i] for i in random.permutation(len(found))):
        length = max(c.at for c in (*kept, crossing)) + 1 + SHOWN
        if not kept or 3 * length * (len(kept) + 1) <= samples:
            kept.append(crossing)
    if not kept:
        return None
    length = max(c.at for c in kept) + 1 + SHOWN
    most = min(MOST, max(1, samples // (3 * length * len(kept))))
    about = [_about(program, random, crossing, length, most) for crossing in kept]
    nearest_first: Raw = np.stack(about, axis=1).reshape(-1, length, len(program.inputs))
    return nearest_first


def crossings(program: Program, drives: Array) -> list[Crossing]:
    """Return the earliest crossing of each limit that is crossed after the first sample."""
    wanted, machine, kind = limits(program), Machine(program), working_type(program)
    state = start_state(program, len(drives))
    before: NDArray[np.bool_] | None = None
    found: dict[int, Crossing] = {}
    for k in range(drives.shape[1] if wanted else 0):
        with np.errstate(all="ignore"):
            slots = machine.step(row(program, drives[:, k], kind), state)
        state = machine.following(slots, len(drives))
        side = np.stack([np.broadcast_to(edge.above(machine, slots), len(drives)) for edge in wanted]) >= 0
        crossed = np.zeros_like(side) if before is None else side != before
        for j in np.flatnonzero(crossed.any(axis=1)):
            found.setdefault(int(j), Crossing(wanted[j], k, drives[int(np.argmax(crossed[j]))]))
        before = side
        if len(found) == len(wanted):
            break
    return [found[j] for j in sorted(found)]


def _about(program: Program, random: np.random.Generator, crossing: Crossing, length: int, most: int) -> Raw:
    """Return the inputs (lanes, length, m) of `most` lanes each on the edge, above and below, the nearest found.

    The sample that is moved is the last one that the value depends on.
    """
    spans = spans_of(program)
    lanes, wanted = TRIED_SHORT if short(program) else TRIED, [crossing.edge]
    machine = Machine(program)
    low, high = np.transpose(spans)
    for wait in range(min(WAIT, crossing.at) + 1):
        first = max(0, crossing.at - wait - VARIED)  # up to which all lanes are one
        at, driven = crossing.at - wait - first, crossing.drive[first : crossing.at + 1]
        inputs = np.repeat(driven[None], lanes, axis=0)
        early = inputs[:, :at]
        early += AMOUNT * (high - low) * random.uniform(-1.0, 1.0, size=early.shape)
        inputs[:, :at] = np.clip(early, low, high)
        one = state_behind(program, machine, crossing.drive[None, :first], start_state(program, 1))
        state = state_behind(program, machine, inputs[:, :at], [np.repeat(x, lanes) for x in one])
        inputs[:, at] = random.uniform(low, high, size=(lanes, len(spans)))
        which, miss = to_an_edge(program, machine, random, inputs, at, state, wanted, wait)
        if np.isfinite(miss).any():
            break
    best = nearest(which, miss, 3 * most)
    begin = np.broadcast_to(crossing.drive[:first], (len(best), first, len(spans)))
    rest = random.uniform(low, high, size=(len(best), length - crossing.at - 1, len(spans)))
    found = np.concatenate([begin, inputs[best], rest], axis=1)
    return np.stack([to_raw(v, found[..., j]) for j, v in enumerate(program.inputs)], axis=-1)

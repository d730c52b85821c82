"""Samples that bring a value to the edge of a limit that it reaches only after many of them.

Inputs that drive the controller hard are followed until a value crosses its limit. The way there is taken again by many
lanes that differ in their last bits, and the sample that crosses is moved to the very edge (`verify/edges.py`). Of each
limit three lanes are kept: on it, next to it above and next to it below.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from quantize.program import Program
from verify.edges import Array, Convert, after, limits, row, short, to_an_edge
from verify.reference import Machine, Raw, start_state, working_type

TRIED, TRIED_SHORT = (
    512,
    8192,
)  # lanes for each limit; many where a unit of an input moves a value by hundreds of its own
VARIED = 2  # samples before the edge that differ from lane to lane,
AMOUNT = 0.01  # by so much of an input's range
WAIT = 3  # samples that the last input which moves a value may lie before it
SHOWN = 2  # samples after the edge, which show what it left


@dataclass(frozen=True, slots=True)
class Crossing:
    """The value `name` passes `limit` in sample `at` of the inputs `drive` (length, m), in their units."""

    name: str
    limit: float
    at: int
    drive: Array


def approaches(
    program: Program, random: np.random.Generator, drives: Array, samples: int, convert: Convert
) -> Raw | None:
    """Return inputs (lanes, length, m) of about `samples` samples; None where no limit is crossed late.

    Parameters
    ----------
    drives
        inputs (lanes, length, m) in their units, to look for crossings in.
    """
    found = crossings(program, drives, convert)
    kept: list[Crossing] = []
    for crossing in (found[i] for i in random.permutation(len(found))):
        length = max(c.at for c in (*kept, crossing)) + 1 + SHOWN
        if not kept or 3 * length * (len(kept) + 1) <= samples:
            kept.append(crossing)
    if not kept:
        return None
    length = max(c.at for c in kept) + 1 + SHOWN
    return np.concatenate([_three(program, random, crossing, length, convert) for crossing in kept])


def crossings(program: Program, drives: Array, convert: Convert) -> list[Crossing]:
    """Return the earliest crossing of each limit that is crossed after the first sample."""
    wanted, machine, kind = limits(program), Machine(program), working_type(program)
    state = start_state(program, len(drives))
    limit = np.array([limit for _, limit in wanted])[:, None]
    before: NDArray[np.bool_] | None = None
    found: dict[int, Crossing] = {}
    for k in range(drives.shape[1] if wanted else 0):
        with np.errstate(all="ignore"):
            slots = machine.step(row(program, drives[:, k], convert, kind), state)
        state = [np.broadcast_to(slots[slot], len(drives)) for slot in machine.next]
        named = machine.named(slots)
        side = np.stack([np.broadcast_to(named[name], len(drives)) for name, _ in wanted]) >= limit
        crossed = np.zeros_like(side) if before is None else side != before
        for j in np.flatnonzero(crossed.any(axis=1)):
            found.setdefault(int(j), Crossing(*wanted[j], k, drives[int(np.argmax(crossed[j]))]))
        before = side
        if len(found) == len(wanted):
            break
    return [found[j] for j in sorted(found)]


def _three(program: Program, random: np.random.Generator, crossing: Crossing, length: int, convert: Convert) -> Raw:
    """Return the inputs (3, length, m) of lanes on the limit, above it and below it, as near as the search came.

    The sample that is moved is the last one that the value depends on.
    """
    spans = [(v.low * 2.0**-v.number.fraction, v.high * 2.0**-v.number.fraction) for v in program.inputs]
    lanes, wanted = TRIED_SHORT if short(program) else TRIED, [(crossing.name, crossing.limit)]
    machine, kind = Machine(program), working_type(program)
    low, high = np.transpose(spans)
    for wait in range(min(WAIT, crossing.at) + 1):
        at = crossing.at - wait
        inputs = random.uniform(low, high, size=(lanes, length, len(spans)))
        inputs[:, : crossing.at + 1] = crossing.drive[: crossing.at + 1]
        early = inputs[:, max(0, at - VARIED) : at]
        early += AMOUNT * (high - low) * random.uniform(-1.0, 1.0, size=early.shape)
        inputs[:, max(0, at - VARIED) : at] = np.clip(early, low, high)
        state = start_state(program, lanes)
        for k in range(at):
            state = after(machine, row(program, inputs[:, k], convert, kind), state)
        inputs[:, at] = random.uniform(low, high, size=(lanes, len(spans)))
        miss = to_an_edge(program, machine, random, inputs, at, state, wanted, convert, wait)
        if np.isfinite(miss).any():
            break
    sides = (miss == 0, miss > 0, miss < 0)
    best = [int(np.argmin(np.where(side, np.abs(miss), np.inf))) for side in sides]
    return np.stack([convert(v, inputs[best, :, j]) for j, v in enumerate(program.inputs)], axis=-1)

"""Samples that bring a value of a program to the edge of a limit: on it, or next to it on either side.

A limit that is wrong by one unit in the last place shows nowhere else. Nor does such a factor where its product is
rounded to an output of fewer places, but next to the edge between two values of that output. A short input moves a long
value by thousands of its units; so many lanes are tried, each behind another noise, and those kept that meet their
limit.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from firmloop.quantize.ops import LIMITS
from firmloop.quantize.program import Program
from firmloop.verify.lanes.compiled import Ways
from firmloop.verify.reference import Machine, Raw, parts, start_state, working_type
from firmloop.verify.scaling import reading, to_raw
from firmloop.verify.stimuli.halving import Lanes, halved

Array = NDArray[np.float64]
Sampled = Callable[[list[Raw], list[Raw]], list[Any]]
COMPARED = ("min", "max", "lt", "le")  # operations that tell which of two values is the larger
ROUNDED = ("shr", "asr")  # operations that drop places of one value
TRIED = 4  # lanes for each that is kept
TRIED_SHORT = 256  # the same where inputs are short: each of their units moves a long value by thousands
MOST_TRIED = 2**18  # lanes in all
PARENTS, CHILDREN = 4096, 64  # of short inputs the nearest lanes are tried again, so often,
PARENTS_LONG, CHILDREN_LONG = 512, 32  # in floating point, to meet a limit itself among its neighbors
MOVED = 64  # and each input by up to so many of its units away: together they come nearer than one alone
HALVINGS = 64  # of the way from one input to the other: to neighbors in any format,
HALVINGS_SHORT = 18  # and in a short one


@dataclass(frozen=True, slots=True)
class Edge:
    """A value changes what an operation does where it passes `limit`: a number, or another value.

    A rounding has such an edge at `limit` and wherever else a multiple of `every` is away from it.
    """

    value: str
    limit: float | str
    every: float = math.inf

    def names(self) -> list[str]:
        """Return the values that it is about."""
        return [at for at in (self.value, self.limit) if isinstance(at, str)]

    def above(self, machine: Machine, slots: list[Any]) -> Array:
        """Return how far above its limit the value is, in one step's values by slot."""
        value, limit = (
            np.asarray(slots[machine.slots[at]] if isinstance(at, str) else at, dtype=np.float64)
            for at in (self.value, self.limit)
        )
        above = np.asarray(value - limit)
        if math.isfinite(self.every):
            above = above - self.every * np.round(above / self.every)
        return above


def limits(program: Program) -> list[Edge]:
    """Return what operations limit or compare, and with what; of a state, what it becomes in this sample.

    Behind them come the edges of the roundings to outputs.
    """
    becomes = {f"self.{a.target}": a.source for a in program.next_state}
    found = []
    shown = {a.source for a in program.results}
    rounded = []
    for op in program.body:
        if op.function in ROUNDED and op.result.name in shown and isinstance(op.arguments[0], str):
            unit = 2.0 ** int(op.arguments[1])
            rounded.append(Edge(op.arguments[0], unit / 2 if op.function == "shr" else unit, unit))
        if op.function not in (*LIMITS, *COMPARED):
            continue
        value, *others = (becomes.get(a, a) if isinstance(a, str) else float(a) for a in op.arguments)
        for other in others:
            if isinstance(value, str):
                found.append(Edge(value, other))
            elif isinstance(other, str):
                found.append(Edge(other, value))
    return list(dict.fromkeys([*found, *rounded]))


def edges(program: Program, random: np.random.Generator, lanes: int, length: int) -> Raw:
    """Return inputs (lanes, length, m): noise, but one sample of a lane at an edge where a way across was found.

    That is the first one in a quarter of the lanes, the last but one in the others: the last shows what it left.
    `convert` rounds physical values into the type of an input.
    """
    spans = spans_of(program)
    wanted = limits(program)
    many = lanes * _tried(program, lanes) if wanted else lanes
    noise = drawn(random, spans, many, length)
    if wanted:
        machine, kind = Machine(program), working_type(program)
        kept = []
        for at, count in ((0, lanes - lanes * 3 // 4), (max(0, length - 2), lanes * 3 // 4)):
            part = noise[: many * count // lanes]
            noise = noise[len(part) :]
            state = state_behind(program, machine, part[:, :at], start_state(program, len(part)))
            which, miss = to_an_edge(program, machine, random, part, at, state, wanted)
            parents, children = (PARENTS, CHILDREN) if short(program) else (min(PARENTS_LONG, count), CHILDREN_LONG)
            if short(program) or not program.arithmetic.startswith("fixed"):
                order = np.repeat(nearest(which, miss, parents), children)
                part, which = _moved(program, random, part[order], at), which[order]
                state = state_behind(program, machine, part[:, :at], start_state(program, len(part)))
                miss = _missed(machine, row(program, part[:, at], kind), state, wanted, which)
            kept.append(part[nearest(which, miss, count, random.random(len(miss)))])
        noise = np.concatenate(kept)
    return np.stack([to_raw(v, noise[..., j]) for j, v in enumerate(program.inputs)], axis=-1)


def _moved(program: Program, random: np.random.Generator, noise: Array, at: int) -> Array:
    """Move inputs by some of their units, in sample `at` and in half of the lanes in the one before it too.

    What moves are worth lies decades apart, as that of an input and of a difference of two; so they are drawn evenly
    over the octaves, with none at all among them, and in every other lane all inputs of a sample move together.
    """
    first, size = max(0, at - 1), (len(noise), 2, len(program.inputs))
    low, high = np.transpose(spans_of(program))
    if program.arithmetic.startswith("fixed"):
        unit = np.array([2.0**-v.number.fraction for v in program.inputs])
        moves = np.floor(np.exp2(random.uniform(-1.0, math.log2(MOVED + 1), size=size)))
        moves *= random.choice([-1.0, 1.0], size=size)
        moves[::2] = moves[::2, :, :1] + np.where(random.random(moves[::2].shape) < 0.5, 0.0, moves[::2])
    else:  # one unit may be worth much already
        unit = np.spacing(np.abs(noise[:, first : at + 1]).astype(working_type(program))).astype(np.float64)
        most = np.exp2(random.uniform(0.0, math.log2(MOVED), size=(len(noise), 1, 1)))
        moves = np.round(random.uniform(-most, most, size=size)) * (random.random(size) < 0.5)
    moves[: len(noise) // 2, 0] = 0.0
    noise[:, first : at + 1] = np.clip(noise[:, first : at + 1] + unit * moves[:, 2 - (at + 1 - first) :], low, high)
    return noise


def _missed(
    machine: Machine,
    inputs: list[Raw],
    state: list[Raw],
    wanted: list[Edge],
    which: NDArray[np.int64],
) -> Array:
    """Return how far above its edge `which` each lane's value is after one sample."""
    asked, found = machine.watch([name for edge in wanted for name in edge.names()]), np.empty(len(which))
    for part in parts(len(which)):
        slots = asked([x[part] for x in inputs], [x[part] for x in state])
        for j, edge in enumerate(wanted):
            found[part] = np.where(which[part] == j, edge.above(machine, slots), found[part])
    return found


def drawn(random: np.random.Generator, spans: list[tuple[float, float]], lanes: int, length: int) -> Array:
    """Return noise (lanes, length, m) in the units of the inputs; in every other pair of lanes they move together.

    There each departs from a common place by amounts over four decades: small errors are what a law works on between
    its limits, and independent inputs have none.
    """
    low, high = np.transpose(spans)
    noise = random.uniform(size=(lanes, length, len(spans)))
    near = noise[2::4], noise[3::4]
    for part in near:
        size = 10.0 ** random.uniform(-4.0, 0.0, size=(len(part), 1, 1))
        part[...] = np.clip(random.uniform(size=(len(part), length, 1)) + size * (part - 0.5), 0.0, 1.0)
    return np.asarray(low + (high - low) * noise)


def nearest(which: NDArray[np.int64], miss: Array, count: int, lot: Array | float = 0.0) -> NDArray[np.int64]:
    """Return `count` lanes, as many on, above and below each edge as there are, the nearest of them first.

    Of lanes that are equally near, those are taken whose `lot` is less: neighbors may be copies of one.
    """
    group = 3 * which + np.sign(np.nan_to_num(miss)).astype(np.int64)
    order = np.lexsort((np.broadcast_to(lot, miss.shape), np.abs(miss), group))
    begins = np.searchsorted(group[order], group[order])
    rank = np.where(np.isfinite(miss[order]), np.arange(len(order)) - begins, len(order))
    return order[np.argsort(rank, kind="stable")[:count]]


def short(program: Program) -> bool:
    """Tell whether every input is a word of 16 bits."""
    return all(v.number.kind == "fixed" and v.number.bits == 16 for v in program.inputs)


def _tried(program: Program, lanes: int) -> int:
    """Return how many lanes to try for each that is kept; a program that solves takes long to try."""
    if program.solves:
        return 1
    return max(TRIED, min(TRIED_SHORT, MOST_TRIED // max(lanes, 1))) if short(program) else TRIED


def to_an_edge(
    program: Program,
    machine: Machine,
    random: np.random.Generator,
    noise: Array,
    at: int,
    state: list[Raw],
    wanted: list[Edge],
    wait: int = 0,
) -> tuple[NDArray[np.int64], Array]:
    """Put sample `at` of every lane at an edge that it can cross; return which, and how far above it its value is.

    `state` is the one before that sample; the value is taken `wait` samples later. `noise` (lanes, length, m) is
    written to; infinite where no way across was found.
    """
    kind, lanes = working_type(program), np.arange(len(noise))
    odd = lanes % 2 == 1  # there the edge is between the limit and what is above, else what is below

    def above_of(asked: list[Edge], names: Machine, asking: Sampled, inputs: Array, part: slice | Lanes) -> Array:
        """Tell of limits (rows) and lanes of a part how far above them the value is."""
        now = [x[part] for x in state]
        for later in range(wait):
            now = machine.after(row(program, noise[part, at + later] if later else inputs, kind), now)
        slots = asking(row(program, noise[part, at + wait] if wait else inputs, kind), now)
        return np.stack([np.broadcast_to(edge.above(names, slots), len(inputs)) for edge in asked])

    def side_of(above: Array, part: slice | Lanes) -> NDArray[np.bool_]:
        return np.where(odd[part], above > 0, above >= 0)

    def same_side(
        edge: Edge, names: Machine, asking: Sampled, side: Raw, some: Lanes, inputs: Array, asked: Lanes
    ) -> NDArray[np.bool_]:
        part = some[asked]
        return np.asarray(side_of(above_of([edge], names, asking, inputs[asked], part)[0], part) == side[asked])

    def read(inputs: Array) -> Raw:
        return np.stack(row(program, inputs, kind)).view(f"u{kind.itemsize}")  # which tells -0 from 0

    halvings = HALVINGS_SHORT if short(program) else HALVINGS
    here, there = noise[:, at].copy(), drawn(random, spans_of(program), len(noise), 1)[:, 0]
    scales = np.array([reading(v) for v in program.inputs])
    every = machine.watch([name for edge in wanted for name in edge.names()])
    sides = np.empty((2, len(wanted), len(noise)), dtype=bool)
    with np.errstate(all="ignore"):
        for part in parts(len(noise)):
            for side, inputs in zip(sides, (here, there), strict=True):
                side[:, part] = side_of(above_of(wanted, machine, every, inputs[part], part), part)
    crossed = sides[0] != sides[1]
    which = np.argmax(random.random(crossed.shape) * crossed, axis=0)
    taken = random.random(len(noise)) < 0.5
    missed = np.empty(len(noise))
    with np.errstate(all="ignore"):
        for j, edge in enumerate(wanted):
            own = np.flatnonzero(which == j)
            names = Machine(_asking(program, edge))
            asking, ready = names.watch(edge.names()), (machine if wait else names).asked(edge.names())
            limit = 0.0 if isinstance(edge.limit, str) else edge.limit
            for some in (own[part] for part in parts(len(own))):
                begin, side, alike = here[some], sides[0, j, some], ~crossed[j, some]
                if ready is not None:
                    way = Ways(begin, there[some], odd[some], side, alike, scales, halvings)
                    behind = np.empty((wait, len(program.inputs), len(some)), kind)
                    for later in range(wait):
                        behind[later] = row(program, noise[some, at + 1 + later], kind)
                    held = np.empty((len(state), len(some)), kind)
                    for mine, x in zip(held, state, strict=True):
                        mine[:] = x[some]
                    near, far = ready.halved(way, limit, edge.every, behind, held)
                else:
                    tell = partial(same_side, edge, names, asking, side, some)
                    near, far = halved(begin, there[some], alike, read, tell, halvings)
                noise[some, at] = begin + np.where(taken[some], near, far)[:, None] * (there[some] - begin)
                missed[some] = above_of([edge], names, asking, noise[some, at], some)[0]
    return which, np.where(crossed[which, lanes], missed, np.inf)


def _asking(program: Program, edge: Edge) -> Program:
    """Return what of a program computes the values of an edge."""
    needed = {edge.value, edge.limit}
    body = []
    for op in reversed(program.body):
        if op.result.name in needed:
            needed.update(a for a in op.arguments if isinstance(a, str))
            body.append(op)
    return replace(program, body=tuple(reversed(body)), next_state=(), results=(), status=(), safe=())


def row(program: Program, inputs: Array, kind: np.dtype[Any]) -> list[Raw]:
    """Return one sample's physical inputs (lanes, m) as the program reads them."""
    return [to_raw(v, inputs[:, j]).astype(kind) for j, v in enumerate(program.inputs)]


def spans_of(program: Program) -> list[tuple[float, float]]:
    """Return the range of every input in its unit."""
    return [(v.low * 2.0**-v.number.fraction, v.high * 2.0**-v.number.fraction) for v in program.inputs]


def state_behind(program: Program, machine: Machine, noise: Array, state: list[Raw]) -> list[Raw]:
    """Return the state behind the samples of `noise` (lanes, length, m), from the one before them."""
    if not noise.shape[1]:
        return state
    whole, kind = [x.copy() for x in state], working_type(program)
    for part in parts(len(noise)):
        held = [x[part] for x in state]
        for k in range(noise.shape[1]):
            held = machine.after(row(program, noise[part, k], kind), held)
        for x, now in zip(whole, held, strict=True):
            x[part] = now
    return whole

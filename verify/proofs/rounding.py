"""Measure how far a Program stands from its Law, in physical units.

Two figures per output. `worst` compares one step from the same state, as the program reads it, and the same inputs, all
within their ranges: this is what the proven bound speaks of. It is sought along the stimuli, and by a search among all
states and inputs that climbs from the farthest ones found. `drift` lets the law run on its own state through each lane;
nothing bounds it, for an integrator keeps what it rounded until feedback or a limit removes it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from firmloop.design.law import Law
from firmloop.quantize.lower.graph import Evaluate, Graph, evaluator, law_graph
from firmloop.quantize.ops import EVERY
from firmloop.quantize.program import Op, Program, Value
from firmloop.verify.block import Block, by_length
from firmloop.verify.lanes.laws import compiled_law
from firmloop.verify.reference import AT_ONCE, Machine, Raw, Trace, parts, working_type
from firmloop.verify.scaling import to_physical
from firmloop.verify.verdict import Rounded

Array = NDArray[np.float64]
SEARCHED = 20_000  # points of one round
ROUNDS = 8
SOLVED = 400  # points of one round, where each is a quadratic program
KEPT = 200  # of a round, to climb from
LANES_AT_ONCE = 2048
LEAST = -(2**31)  # what the unset state of a fixed-point program holds


def measure_rounding(
    law: Law, program: Program, blocks: Sequence[Block], traces: Sequence[Trace]
) -> tuple[Rounded, ...]:
    """Return the worst differences over all blocks, output by output.

    A step of the law is computed in float64; in this machine's long double where the program is in float64, else
    nothing would be seen.
    """
    real: np.dtype[Any] = np.dtype(
        np.longdouble if program.arithmetic == "float64" and law.solve is None else np.float64
    )
    graph = law_graph(law)
    means, free = _compiled(law, graph, real) or evaluator(graph), _Free(law, graph)
    drift = np.zeros(len(program.outputs))
    with np.errstate(all="ignore"):
        worst = _searched(law, program, means, real)
        for raw, held, outputs in _side_by_side(blocks, traces):
            for part in parts(len(raw[0]), max(1, AT_ONCE // raw[0].shape[1])):
                one, other = ([x[part] for x in found] for found in (raw, held))
                got = [to_physical(v, x[part]) for v, x in zip(program.outputs, outputs, strict=True)]
                apart = _apart(law, program, means, one, other, got, real)
                worst = np.maximum(worst, [np.max(row, initial=0.0) for row in apart])
            inside = [_inside(v, x) for v, x in zip(program.inputs, raw, strict=True)]
            calm = np.flatnonzero(np.all(inside, axis=(0, 2)))
            if len(calm):
                inputs = [to_physical(v, x[calm]) for v, x in zip(program.inputs, raw, strict=True)]
                set_to = held[len(held) - len(program.tunable) :]
                fed = [to_physical(v, x[calm]) for v, x in zip(program.parameters, set_to, strict=True)]
                own = zip(program.outputs, outputs, free.run(inputs, fed), strict=True)
                away = [np.max(np.abs(to_physical(v, g[calm]) - e), initial=0.0) for v, g, e in own]
                drift = np.maximum(drift, away)
    bounds = {r.output: r for r in program.rounding}
    return tuple(
        Rounded(v.name, float(worst[j]), bounds[v.name].bound, v.unit, float(drift[j]))
        for j, v in enumerate(program.outputs)
    )


def _side_by_side(blocks: Sequence[Block], traces: Sequence[Trace]) -> Iterator[tuple[list[Raw], list[Raw], list[Raw]]]:
    """Return inputs, state and outputs, an array (lanes, steps) of each, of some lanes of one length after others."""
    for group in by_length(blocks):
        for part in parts(sum(len(blocks[i].inputs) for i in group), LANES_AT_ONCE):
            yield (
                _lanes([blocks[i].inputs for i in group], part),
                _lanes([traces[i].state for i in group], part),
                _lanes([traces[i].outputs for i in group], part),
            )


def _lanes(arrays: Sequence[Raw], part: slice) -> list[Raw]:
    """Return columns (lanes, steps) of a part of the lanes of all these arrays (lanes, steps, columns)."""
    begins = np.cumsum([0, *map(len, arrays)])
    cut = [x[max(0, part.start - b) : max(0, part.stop - b)] for x, b in zip(arrays, begins[:-1], strict=True)]
    pieces = [piece for piece in cut if len(piece)]
    found = pieces[0] if len(pieces) == 1 else np.concatenate(pieces)
    return [found[..., j] for j in range(found.shape[2])]


def _apart(
    law: Law,
    program: Program,
    means: Evaluate,
    raw: Sequence[Raw],
    held: Sequence[Raw],
    got: Sequence[Array],
    real: np.dtype[Any],
) -> list[Array]:
    """Return |program - law| of each output and sample; 0 where an input or a state is not in its range."""
    fresh = _fresh(program, raw, held)
    valid = np.all([_inside(v, x) for v, x in zip(program.inputs, raw, strict=True)], axis=0)
    own = [fresh | _inside(v, x) for v, x in zip(program.state, held, strict=True)]
    valid &= np.all(own, axis=0) if own else True
    read = _as_read(program, held)
    by_name = {v.name: to_physical(v, x) for v, x in zip(program.state, read, strict=True)}
    state = []
    for signal, start in zip(law.state, law.start, strict=True):
        if signal.name == law.opening:
            state.append(np.where(fresh, 0.0, 1.0))
        elif signal.name in law.tunable:
            state.append(by_name[signal.name])
        else:
            state.append(np.where(fresh, start, by_name[signal.name]))
    inputs = [to_physical(v, x) for v, x in zip(program.inputs, raw, strict=True)]
    expected = means([[x.astype(real) for x in state], [z.astype(real) for z in inputs]])[1]
    return [np.where(valid, np.abs(g - e), 0.0).astype(np.float64) for g, e in zip(got, expected, strict=True)]


def _as_read(program: Program, held: Sequence[Raw]) -> list[Raw]:
    """Return the state as a fixed-point program reads it, where it limits the words as it does so."""
    reads: dict[object, Op] = {}
    for op in program.body if program.arithmetic.startswith("fixed") else ():
        if op.function in ("clamp", "wrap"):
            reads.setdefault(op.arguments[0], op)
    found = []
    for value, x in zip(program.state, held, strict=True):
        read = reads.get(f"self.{value.name}")
        found.append(np.asarray(EVERY[read.function].run(x, *read.arguments[1:])) if read is not None else x)
    return found


def _fresh(program: Program, raw: Sequence[Raw], held: Sequence[Raw]) -> NDArray[np.bool_]:
    """Tell where the controller itself finds that it stands before its first sample, or has to start afresh."""
    unset = (f"self.{program.unset}", LEAST)
    asks = [
        k
        for k, op in enumerate(program.body)
        if (op.function in ("lost", "none") and op.result.name == "fresh")
        or (op.function == "eq" and op.arguments == unset)
    ]
    if not asks:
        return np.zeros(np.shape(raw[0]) if raw else (), dtype=bool)
    asking = replace(program, body=program.body[: asks[0] + 1], next_state=(), results=(), status=(), safe=())
    machine, kind = Machine(asking), working_type(program)
    slots = machine.step([x.astype(kind) for x in raw], [x.astype(kind) for x in held])
    return np.asarray(machine.named(slots)[asking.body[-1].result.name], dtype=bool)


def _inside(value: Value, raw: Raw) -> NDArray[np.bool_]:
    return (raw >= value.low) & (raw <= value.high)


def _searched(law: Law, program: Program, means: Evaluate, real: np.dtype[Any]) -> Array:
    """Return the worst differences that a search finds, output by output."""
    random = np.random.default_rng(1)
    machine = Machine(program)
    watched = machine.watch([a.source for a in machine.program.results])
    count = SEARCHED if law.solve is None else SOLVED
    kept = KEPT * count // SEARCHED
    values = (*program.inputs, *program.state)
    worst = np.zeros(len(program.outputs))
    if not all(np.isfinite(v.low) and np.isfinite(v.high) for v in values):
        return worst
    low, high = np.transpose([_drawn(law, v) for v in values])[:, :, None]
    for j in range(len(program.outputs)):
        points = low + (high - low) * random.random((len(values), count))
        points[:, : count // 2] *= 10.0 ** random.uniform(-3, 0, size=count // 2)
        for _ in range(ROUNDS):
            points = np.clip(points, low, high)
            raw = [_whole(v, x) for v, x in zip(values, points, strict=True)]
            inputs, held = raw[: len(program.inputs)], raw[len(program.inputs) :]
            kind = working_type(program)
            slots = watched([x.astype(kind) for x in inputs], [x.astype(kind) for x in held])
            outputs = zip(program.outputs, machine.results, strict=True)
            got = [to_physical(v, np.broadcast_to(slots[s], count)) for v, s in outputs]
            apart = _apart(law, program, means, inputs, held, got, real)
            worst = np.maximum(worst, [np.max(row, initial=0.0) for row in apart])
            best = points[:, np.argsort(-apart[j])[:kept]]
            again = np.repeat(best, count // kept, axis=1)
            moves = random.normal(size=again.shape) * 10.0 ** random.uniform(-8, -0.5, size=(1, count))
            points = again + (high - low) * moves * (random.random(again.shape) < 0.5)
    return worst


def _drawn(law: Law, value: Value) -> tuple[float, float]:
    """Return the raw range in which a value is sought: of a state, what the law proves, though its word holds more.

    The program saturates at a power of two above that; a state that no step leaves, such as an output of the sample
    before that is beyond its limits, is not compared. What a trace has reached is, wherever it is.
    """
    proven = next((s for s in law.state if s.name == value.name and s.name not in law.tunable), None)
    if proven is None or value.number.kind == "float":
        return value.low, value.high
    scale = 2.0**value.number.fraction
    return max(value.low, math.ceil(proven.low * scale)), min(value.high, math.floor(proven.high * scale))


def _whole(value: Value, x: Array) -> Raw:
    """Round to what the value's type holds, within its range."""
    if value.number.kind == "fixed":
        return np.clip(np.rint(x), value.low, value.high).astype(np.int64)
    return x.astype(np.float32 if value.number.bits == 32 else np.float64)


def _compiled(law: Law, graph: Graph, real: np.dtype[Any]) -> Evaluate | None:
    """Return the law in compiled code, None where that does not know all of it."""
    ready = compiled_law(graph, len(law.state), len(law.inputs), (), real)
    if ready is None:
        return None

    def evaluated(arguments: Sequence[Sequence[Array]]) -> list[list[Array]]:
        state, inputs = arguments
        shape = np.shape(inputs[0])
        given = np.stack([np.ravel(x) for x in (*inputs, *state)])[None]
        results = ready.results(given, np.empty((0, given.shape[2]), real))
        return [[], [x.reshape(shape) for x in results[0]]]

    return evaluated


class _Free:
    """The law on its own state, ready to run; its parameters are those that the program held, the last of its state."""

    def __init__(self, law: Law, graph: Graph) -> None:
        self.law, self.own = law, len(law.state) - len(law.tunable)
        self.means = evaluator(graph)
        self.ready = compiled_law(graph, len(law.state), len(law.inputs), range(self.own))

    def run(self, inputs: list[Array], fed: list[Array]) -> list[Array]:
        """Return the outputs (lanes, steps), each lane from the law's start, its parameters `fed` to it."""
        lanes, steps = inputs[0].shape
        start = [np.full(lanes, x) for x in self.law.start]
        outputs = np.empty((len(self.law.outputs), lanes, steps))
        if self.ready is not None:
            given, found = (np.transpose(x, (2, 0, 1)) for x in (np.stack([*inputs, *fed]), outputs))
            self.ready.run(given, np.array(start[: self.own]), found)
            return list(outputs)
        if not start:  # no step knows of another: all at once
            return [np.broadcast_to(y, (lanes, steps)) for y in self.means([[], inputs])[1]]
        state = start
        for k in range(steps):
            state[self.own :] = [x[:, k] for x in fed]
            row = self.means([state, [x[:, k] for x in inputs]])
            state = [np.broadcast_to(x, lanes) for x in row[0]]
            for y, value in zip(outputs, row[1], strict=True):
                y[:, k] = value
        return list(outputs)

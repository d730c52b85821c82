"""Measure how far a Program stands from its Law, in physical units.

Two figures per output. `worst` compares one step from the program's own state and inputs: this is what the proven
bound speaks of. `drift` lets the law run on its own state through each lane; nothing bounds it, for an integrator
keeps what it rounded until feedback or a limit removes it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from design.law import Law
from quantize.graph import Graph, evaluate, read_graph
from quantize.program import Program
from verify.reference import Raw, Trace
from verify.stimuli import Block, to_physical
from verify.verdict import Rounded

Array = NDArray[np.float64]


def measure_rounding(
    law: Law, program: Program, blocks: Sequence[Block], traces: Sequence[Trace]
) -> tuple[Rounded, ...]:
    """Return the worst differences over all blocks, output by output."""
    graph = read_graph(law.stages[0].function)
    worst = np.zeros(len(program.outputs))
    drift = np.zeros(len(program.outputs))
    with np.errstate(all="ignore"):
        for block, trace in zip(blocks, traces, strict=True):
            inputs = _used_inputs(program, block.inputs)
            state = [to_physical(v, trace.state[..., j]) for j, v in enumerate(program.state)]
            got = [to_physical(v, trace.outputs[..., j]) for j, v in enumerate(program.outputs)]
            expected = evaluate(graph, [state, inputs])[1]
            worst = np.maximum(worst, [_apart(g, e) for g, e in zip(got, expected, strict=True)])
            free = _free_run(program, law, graph, inputs, state)
            drift = np.maximum(drift, [_apart(g, e) for g, e in zip(got, free, strict=True)])
    bounds = {r.output: r for r in program.rounding}
    return tuple(
        Rounded(v.name, float(worst[j]), bounds[v.name].bound, v.unit, float(drift[j]))
        for j, v in enumerate(program.outputs)
    )


def _used_inputs(program: Program, raw: Raw) -> list[Array]:
    """Return the inputs as the program takes them: limited to their range, a NaN at the low end."""
    columns = []
    for j, value in enumerate(program.inputs):
        scale = 2.0**-value.number.fraction
        low, high = value.low * scale, value.high * scale
        x = to_physical(value, raw[..., j])
        columns.append(np.minimum(np.where(x > low, x, low), high))
    return columns


def _free_run(program: Program, law: Law, graph: Graph, inputs: list[Array], held: list[Array]) -> list[Array]:
    """Run the law on its own state; its parameters are those that the program held, `held[-k:]`."""
    lanes, steps = inputs[0].shape
    state = [np.full(lanes, x) for x in law.start]
    outputs = [np.empty((lanes, steps)) for _ in law.outputs]
    for k in range(steps):
        for j in range(len(state) - len(program.tunable), len(state)):
            state[j] = held[j][:, k]
        row = evaluate(graph, [state, [x[:, k] for x in inputs]])
        state = [np.broadcast_to(x, lanes) for x in row[0]]
        for y, value in zip(outputs, row[1], strict=True):
            y[:, k] = value
    return outputs


def _apart(a: Array, b: Array) -> float:
    return float(np.max(np.abs(a - b), initial=0.0))

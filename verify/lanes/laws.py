"""Evaluate a law in compiled code, in float64 or longer numbers, once or on its own state through many samples."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from firmloop.design.law import Horizon
from firmloop.quantize.lower.graph import Graph, Node, law_graph
from firmloop.quantize.twins.qp import Rows, exact
from firmloop.quantize.twins.rti_course import exact_course
from firmloop.verify.lanes.codes import PLANS
from firmloop.verify.lanes.compiled import Compiled, RowStep, library, runs
from firmloop.verify.lanes.plans import Improved, known_as, with_plans

# The operations of the compiled code that mean what those of a law do, where they have other names or operands.
SAME = {
    **{"square": "mul", "twice": "add", "abs": "magnitude", "choose": "select", "if": "select"},
    **{name: f"true_{name}" for name in ("sin", "cos", "exp", "tanh", "sqrt")},
}
FLOAT64: np.dtype[Any] = np.dtype(np.float64)


def compiled_law(
    graph: Graph, states: int, inputs: int, own: Sequence[int], kind: np.dtype[Any] = FLOAT64
) -> Compiled | None:
    """Return a law over its states and inputs, ready to run; None where the compiled code does not know all of it.

    The states `own` are followed from sample to sample. What else it takes are inputs: the law's inputs, then the other
    states in order. Its results are the law's outputs. `kind` is the type of its numbers.
    """
    code, zero = library(), len(graph.nodes)
    rows, constants, steps = {}, {zero: 0.0}, []
    for k, node in enumerate(graph.nodes):
        if node.function == "argument":
            rows[node.place] = k
        elif node.function == "constant":
            constants[k] = node.value
        else:
            steps.append(_step(k, node, zero))
    if code is None or not runs(kind, [known_as(step) for step in steps]):
        return None
    plans: dict[int, Rows | Improved] = {}
    for step in steps:
        if step.function in PLANS:
            plan = _plan(graph)
            if plan is None:
                return None
            plans[step.target] = plan
    free = iter(range(zero + 1, zero + 1 + states + inputs + 1))  # of arguments that nothing reads
    given = [rows[1, j] if (1, j) in rows else next(free) for j in range(inputs)]
    held = [rows[0, j] if (0, j) in rows else next(free) for j in range(states)]
    fed = [held[j] for j in range(states) if j not in own]
    following, outputs = graph.results[0], graph.results[1]
    spread, constants = with_plans(steps, constants, next(free), plans)
    return Compiled(
        *(code, kind, spread, constants, [*given, *fed], [held[j] for j in own]),
        *([following[j] for j in own], outputs),
    )


def _plan(graph: Graph) -> Rows | Improved | None:
    """Return the program that a law solves, with its model where it has one; None where no search solves it."""
    assert graph.solve is not None
    problem = graph.solve.problem
    if not isinstance(problem, Horizon):
        return exact(problem) if graph.solve.method is None else None
    ready = compiled_law(law_graph(problem.model), 0, len(problem.model.inputs), ())
    return None if ready is None else (exact_course(problem), ready)


def _step(target: int, node: Node, zero: int) -> RowStep:
    places = node.arguments * 2 if node.function in ("square", "twice") else node.arguments
    whole = (node.place[1],) if node.function == "move" else ()
    name = SAME.get(node.function, node.function)
    return RowStep(name, target, (*places, zero) if node.function == "if" else places, whole)

"""Read a CasADi SX function as a list of nodes, each computed once from earlier ones.

CasADi's own instruction list reuses its work registers; here every node keeps its number, so that bounds, formats and
names can be attached to it. Reference: the `instruction_*` functions of `casadi.Function`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from operator import itemgetter
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from firmloop.design.law import Horizon, Law, Solve
from firmloop.design.outcome import CAPPED, INFEASIBLE
from firmloop.design.quadratic.solver import solver as quadratic_solver
from firmloop.quantize.program import QuantizeError
from firmloop.quantize.twins.qp import optimum
from firmloop.quantize.twins.rti import improve
from firmloop.quantize.twins.rti_course import exact_course

Array = NDArray[np.float64]
Evaluate = Callable[[Sequence[Sequence[Array]]], list[list[Array]]]

# CasADi operation -> (our name, number of arguments)
KNOWN = {
    ca.OP_ADD: ("add", 2),
    ca.OP_SUB: ("sub", 2),
    ca.OP_MUL: ("mul", 2),
    ca.OP_DIV: ("div", 2),
    ca.OP_NEG: ("neg", 1),
    ca.OP_SQ: ("square", 1),
    ca.OP_TWICE: ("twice", 1),
    ca.OP_FMIN: ("min", 2),
    ca.OP_FMAX: ("max", 2),
    ca.OP_FABS: ("abs", 1),
    ca.OP_LT: ("lt", 2),
    ca.OP_LE: ("le", 2),
    ca.OP_EQ: ("eq", 2),
    ca.OP_NE: ("ne", 2),
    ca.OP_AND: ("and", 2),
    ca.OP_OR: ("or", 2),
    ca.OP_NOT: ("not", 1),
    ca.OP_IF_ELSE_ZERO: ("if", 2),
    ca.OP_SIN: ("sin", 1),
    ca.OP_COS: ("cos", 1),
    ca.OP_EXP: ("exp", 1),
    ca.OP_TANH: ("tanh", 1),
    ca.OP_SQRT: ("sqrt", 1),
}
FLOATING_ONLY = ("exp", "tanh")

# What each node means, in float64: the law itself.
MEANING: dict[str, Callable[..., Any]] = {
    "add": lambda a, b: a + b,
    "sub": lambda a, b: a - b,
    "mul": lambda a, b: a * b,
    "div": lambda a, b: a / b,
    "sin": np.sin,
    "cos": np.cos,
    "exp": np.exp,
    "tanh": np.tanh,
    "sqrt": np.sqrt,
    "neg": lambda a: -a,
    "square": lambda a: a * a,
    "twice": lambda a: a + a,
    "min": lambda a, b: np.where(a < b, a, b),
    "max": lambda a, b: np.where(a > b, a, b),
    "abs": np.abs,
    "lt": lambda a, b: np.where(a < b, 1.0, 0.0),
    "le": lambda a, b: np.where(a <= b, 1.0, 0.0),
    "eq": lambda a, b: np.where(a == b, 1.0, 0.0),
    "ne": lambda a, b: np.where(a != b, 1.0, 0.0),
    "and": lambda a, b: np.where((a != 0) & (b != 0), 1.0, 0.0),
    "or": lambda a, b: np.where((a != 0) | (b != 0), 1.0, 0.0),
    "not": lambda a: np.where(a == 0, 1.0, 0.0),
    "if": lambda c, a: np.where(c != 0, a, 0.0),
    "capped": lambda plan: np.where(plan[-1] == CAPPED, 1.0, 0.0),
    "infeasible": lambda plan: np.where(plan[-1] == INFEASIBLE, 1.0, 0.0),
    "choose": lambda c, a, b: np.where(c != 0, a, b),
}


@dataclass(frozen=True, slots=True)
class Node:
    """`function` of earlier nodes; "constant" carries `value`, "argument" and "move" which one they are."""

    function: str
    arguments: tuple[int, ...]
    value: float
    place: tuple[int, int]


@dataclass(frozen=True, slots=True)
class Graph:
    """Nodes in order; `results[i][j]` is the node of element j of output i.

    A "solve" or "improve" node solves as `solve` says; `solver` is that: parameters (lanes, p) -> results and status.
    """

    nodes: tuple[Node, ...]
    results: tuple[tuple[int, ...], ...]
    solve: Solve | None = None
    solver: Callable[[Array], Array] | None = None


def read_graph(function: ca.Function) -> Graph:
    """Rename CasADi's registers to one node per assignment.

    Raises
    ------
    QuantizeError
        when the function holds an operation that no Program operation stands for.
    """
    nodes: list[Node] = []
    register: dict[int, int] = {}
    outputs: dict[tuple[int, int], int] = {}

    def add(node: Node) -> int:
        nodes.append(node)
        return len(nodes) - 1

    for k in range(function.n_instructions()):
        code = function.instruction_id(k)
        source, target = function.instruction_input(k), function.instruction_output(k)
        if code == ca.OP_CONST:
            register[target[0]] = add(Node("constant", (), function.instruction_constant(k), (0, 0)))
        elif code == ca.OP_INPUT:
            register[target[0]] = add(Node("argument", (), 0.0, (source[0], source[1])))
        elif code == ca.OP_OUTPUT:
            outputs[target[0], target[1]] = register[source[0]]
        elif code in KNOWN:
            name, arity = KNOWN[code]
            register[target[0]] = add(Node(name, tuple(register[s] for s in source[:arity]), 0.0, (0, 0)))
        elif code == ca.OP_INV:
            one = add(Node("constant", (), 1.0, (0, 0)))
            register[target[0]] = add(Node("div", (one, register[source[0]]), 0.0, (0, 0)))
        else:
            raise QuantizeError(
                f"the law uses a CasADi operation (number {code}) that has no bit-exact counterpart; "
                f"it may use: {', '.join(sorted(name for name, _ in KNOWN.values()))}"
            )
    results = []
    for i in range(function.n_out()):
        sparsity = function.sparsity_out(i)
        row = {r: j for j, r in enumerate(sparsity.row())}
        missing = [r for r in range(sparsity.size1()) if r not in row]
        zero = add(Node("constant", (), 0.0, (0, 0))) if missing else -1
        results.append(tuple(outputs[i, row[r]] if r in row else zero for r in range(sparsity.size1())))
    return pruned(Graph(tuple(_with_choices(nodes)), tuple(results)))


def _with_choices(nodes: Sequence[Node]) -> list[Node]:
    """Read (c ? a : 0) + (not c ? b : 0), which is how CasADi writes a choice, as c ? a : b."""
    found = list(nodes)
    for k, node in enumerate(nodes):
        if node.function != "add" or any(nodes[a].function != "if" for a in node.arguments):
            continue
        one, other = (nodes[a].arguments for a in node.arguments)
        if nodes[one[0]].function == "not":
            one, other = other, one
        inverse = nodes[other[0]]
        if inverse.function == "not" and inverse.arguments == (one[0],):
            found[k] = Node("choose", (one[0], one[1], other[1]), 0.0, (0, 0))
    return found


def needed(graph: Graph, rows: int) -> set[int]:
    """Return the nodes that the first `rows` results follow from."""
    found = {k for row in graph.results[:rows] for k in row}
    for k in reversed(range(len(graph.nodes))):
        if k in found:
            found.update(graph.nodes[k].arguments)
    return found


def with_own_constants(graph: Graph) -> Graph:
    """Give every operation constants of its own: CasADi writes a number once, though its uses need not meet."""
    nodes: list[Node] = []
    place: dict[int, int] = {}

    def copied(k: int) -> int:
        if graph.nodes[k].function == "constant":
            nodes.append(graph.nodes[k])
            return len(nodes) - 1
        return place[k]

    for k, node in enumerate(graph.nodes):
        if node.function != "constant":
            arguments = tuple([copied(a) for a in node.arguments])
            nodes.append(replace(node, arguments=arguments))
            place[k] = len(nodes) - 1
    results = tuple(tuple([copied(k) for k in row]) for row in graph.results)
    return replace(graph, nodes=tuple(nodes), results=results)


def pruned(graph: Graph) -> Graph:
    """Leave out what no result needs."""
    kept = sorted(needed(graph, len(graph.results)))
    place = {k: new for new, k in enumerate(kept)}
    nodes = [replace(graph.nodes[k], arguments=tuple(place[a] for a in graph.nodes[k].arguments)) for k in kept]
    return replace(graph, nodes=tuple(nodes), results=tuple(tuple(place[k] for k in row) for row in graph.results))


def law_graph(law: Law) -> Graph:
    """Read all stages of a law as one graph over its state and inputs, each of which is one node.

    Raises
    ------
    QuantizeError
        when a stage holds an operation that no Program operation stands for.
    """
    last = read_graph(law.last.function)
    if law.solve is None:
        return last
    before, problem = read_graph(law.solve.function), law.solve.problem
    nodes = list(before.nodes)
    plan = len(nodes)
    nodes.append(Node("improve" if isinstance(problem, Horizon) else "solve", before.results[0], 0.0, (0, 0)))
    nodes += [Node("move", (plan,), 0.0, (0, k)) for k in range(problem.results)]
    nodes += [Node(status, (plan,), 0.0, (0, 0)) for status in ("capped", "infeasible")]
    read = {node.place: k for k, node in enumerate(before.nodes) if node.function == "argument"}
    results: dict[int, int] = {}
    for k, node in enumerate(last.nodes):
        if node.function == "argument" and node.place[0] == 2:
            results[k] = plan + 1 + node.place[1]
            continue
        if node.function == "argument" and node.place in read:
            results[k] = read[node.place]  # another node of it would be given a format of its own
            continue
        results[k] = len(nodes)
        nodes.append(replace(node, arguments=tuple(results[a] for a in node.arguments)))
    rows = tuple(tuple(results[k] for k in row) for row in last.results)
    return Graph(tuple(nodes), rows, law.solve, solver_of(law.solve))


def evaluator(graph: Graph) -> Evaluate:
    """Return what evaluates a graph in float64 on whole arrays at once, made ready for many calls.

    Of its argument, `arguments[i][j]` is element j of input i, of any shape.
    """
    constants: list[Any] = [None] * len(graph.nodes)
    read: list[tuple[int, int, int]] = []
    steps: list[tuple[int, Callable[..., Any], tuple[int, ...]]] = []
    for k, node in enumerate(graph.nodes):
        if node.function == "constant":
            constants[k] = np.float64(node.value)
        elif node.function == "argument":
            read.append((k, *node.place))
        elif node.function in ("solve", "improve"):
            steps.append((k, lambda *parameters: _solved(graph.solver, parameters), node.arguments))
        elif node.function == "move":
            steps.append((k, itemgetter(node.place[1]), node.arguments))
        else:
            steps.append((k, MEANING[node.function], node.arguments))

    def evaluated(arguments: Sequence[Sequence[Array]]) -> list[list[Array]]:
        values = constants.copy()
        for k, i, j in read:
            values[k] = arguments[i][j]
        for k, run, places in steps:
            values[k] = run(*[values[p] for p in places])
        return [[values[n] for n in row] for row in graph.results]

    return evaluated


def solver_of(solve: Solve) -> Callable[[Array], Array]:
    """Return what solves a problem in float64: parameters (lanes, p) -> results and status, a row each."""
    if not isinstance(solve.problem, Horizon):
        found = quadratic_solver(solve, optimum)

        def solved(parameters: Array) -> Array:
            solution = found(parameters)
            return np.vstack([solution.moves.T, solution.status])

        return solved
    course = exact_course(solve.problem)
    model = evaluator(law_graph(solve.problem.model))

    def iterated(parameters: Array) -> Array:
        results, status = improve(course, lambda both: model([[], both])[1], parameters)
        return np.vstack([results.T, status])

    return iterated


def _solved(solver: Callable[[Array], Array] | None, parameters: Sequence[Array]) -> Array:
    """Return the results and the status, one row each, in the shape of the parameters."""
    assert solver is not None
    stacked = np.stack(np.broadcast_arrays(*parameters), axis=-1)
    results = solver(stacked.reshape(-1, stacked.shape[-1]))
    return results.reshape(len(results), *stacked.shape[:-1])

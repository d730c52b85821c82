"""Let a controller find its own first sample: no flag beside the state, no work in any later sample.

A law says in `first` what its state is where the first inputs had always stood. The program keeps one state variable at
a value that it cannot have otherwise, until the first sample: the least integer in fixed point, not a number in
floating point. There the same test finds a controller that a NaN or an infinity has reached, and starts it
afresh.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import casadi as ca

from firmloop.design.law import Law, Scalar
from firmloop.quantize.lower.first_sample import merged
from firmloop.quantize.lower.graph import Graph, Node, law_graph, pruned, read_graph
from firmloop.quantize.lower.limits import with_limits
from firmloop.quantize.lower.vanishing import vanishes

PASSING = ("add", "sub", "neg", "twice", "mul", "square")  # not finite where any operand is not, and not the constant 0


@dataclass(frozen=True, slots=True)
class Opened:
    """A law whose function has a third argument, the truth value `fresh`, and no state that says the same.

    `probes`: places of the state variables that tell when the controller is fresh; `unset`: the one that says so from
    the start, None where the start needs no telling. Where no input sets the state, nobody asks `fresh`: what is lost
    is put back as the sample ends.
    """

    law: Law
    graph: Graph
    probes: tuple[int, ...]
    unset: int | None
    asks: str = "lost"  # what `fresh` asks of the probes' sum


def opened(law: Law, floating: bool) -> Opened:
    """Rewrite `law` for fixed or for floating point; one that solves in every step is for floating point only."""
    if law.solve is not None:
        return _solving(law) if floating else Opened(law, law_graph(law), (), None)
    flag = next((j for j, s in enumerate(law.state) if s.name == law.opening), None)
    kept = [j for j in range(len(law.state)) if j != flag]
    x, z, fresh = ca.SX.sym("x", len(law.state)), ca.SX.sym("z", len(law.inputs)), ca.SX.sym("fresh")
    first = law.first(x, z) if law.first is not None else x
    begun: list[ca.SX] = [x[j] for j in range(len(law.state))]
    own: list[int] = []  # state that the first inputs set
    for j in kept:
        if law.state[j].name in law.tunable:
            continue
        if law.first is not None and ca.depends_on(first[j], z):
            own.append(j)
            begun[j] = ca.if_else(fresh, first[j], x[j])
    if floating and own:
        for j in kept:
            if j not in own and law.state[j].name not in law.tunable:
                begun[j] = ca.if_else(fresh, law.start[j], x[j])
    if flag is not None:
        begun[flag] = ca.SX(1)
    stage = law.last
    state, nothing = ca.SX.sym("begun", len(law.state)), ca.SX(0, 1)
    after, u, flags, named = stage.function(ca.vertcat(*(1 if j == flag else state[j] for j in range(len(begun)))), z)
    rows = [x[kept] if kept else nothing, z, fresh, state]
    results = [after[kept] if kept else nothing, u, flags, named]
    # What the first sample chooses from stands in front, then what it chooses: so both are one branch, and a short one.
    front = ca.vertcat(*(first[j] for j in own), *begun, 0)
    graph = merged(_joined(read_graph(ca.Function("law", rows, [front, *results])), len(own)))
    shorter = replace(
        law,
        state=tuple(law.state[j] for j in kept),
        start=tuple(law.start[j] for j in kept),
        why=tuple(law.why[j] for j in kept),
        stages=(Scalar(stage.function, stage.named),),
    )
    if not floating:
        unset = kept.index(own[0]) if own else None
        return Opened(shorter, graph, (unset,) if unset is not None else (), unset)
    mortal = [k for k, j in enumerate(kept) if law.state[j].name not in law.tunable]
    probes = _probes(graph, mortal)
    asks = "none" if vanishes(graph, mortal, probes) else "lost"
    if not own:
        return Opened(shorter, _put_back(graph, shorter.start, mortal, probes, asks), (), None)
    return Opened(shorter, graph, probes, probes[0], asks)


def _put_back(graph: Graph, start: Sequence[float], mortal: Sequence[int], probes: Sequence[int], asks: str) -> Graph:
    """Give each of `mortal` its start for the next sample where the sum of the probes would be lost."""
    if not probes:
        return graph
    nodes, after = list(graph.nodes), list(graph.results[0])

    def add(function: str, *arguments: int, value: float = 0.0) -> int:
        nodes.append(Node(function, arguments, value, (0, 0)))
        return len(nodes) - 1

    total = after[probes[0]]
    for k in probes[1:]:
        total = add("add", total, after[k])
    gone = add(asks, total)
    after = [add("choose", gone, add("constant", value=start[k]), j) if k in mortal else j for k, j in enumerate(after)]
    return replace(graph, nodes=tuple(nodes), results=(tuple(after), *graph.results[1:]))


def _solving(law: Law) -> Opened:
    """Start each state variable of a law that solves where `fresh`; its inputs do not say where that is."""
    assert law.first is None and not law.opening and not law.tunable, "its state starts as declared, and nobody sets it"
    graph = law_graph(law)
    limited = with_limits(graph)
    if all(limited.nodes[k].function == "clamp" for k in limited.results[0]):  # a limit for a NaN: nothing is ever lost
        return Opened(law, graph, (), None)
    nodes = [Node("argument", (), 0.0, (2, 0))]
    place: dict[int, int] = {}
    for k, node in enumerate(graph.nodes):
        nodes.append(replace(node, arguments=tuple(place[a] for a in node.arguments)))
        if node.function == "argument" and node.place[0] == 0:
            nodes.append(Node("constant", (), law.start[node.place[1]], (0, 0)))
            nodes.append(Node("choose", (0, len(nodes) - 1, len(nodes) - 2), 0.0, (0, 0)))
        place[k] = len(nodes) - 1
    begun = replace(graph, nodes=tuple(nodes), results=tuple(tuple(place[k] for k in row) for row in graph.results))
    return Opened(law, begun, _probes(begun, range(len(law.state))), None)


def _joined(graph: Graph, before: int) -> Graph:
    """Put the state that is chosen, `before` nodes into the first result, in place of the fourth argument.

    CasADi would otherwise draw the choice through every product that follows.
    """
    chosen = graph.results[0][before:]
    place = {
        k: chosen[n.place[1]] if n.function == "argument" and n.place[0] == 3 else k for k, n in enumerate(graph.nodes)
    }
    nodes = tuple(replace(node, arguments=tuple(place[a] for a in node.arguments)) for node in graph.nodes)
    assert all(a < k for k, node in enumerate(nodes) for a in node.arguments), "chosen before it is used"
    return pruned(Graph(nodes, tuple(tuple(place[k] for k in row) for row in graph.results[1:])))


def _probes(graph: Graph, mortal: Sequence[int]) -> tuple[int, ...]:
    """Return few state variables such that what is not finite reaches one of them from any of `mortal`."""
    follows = {j: _reached(graph, j, mortal) for j in mortal}
    for _ in mortal:
        follows = {j: found.union(*(follows[k] for k in found)) for j, found in follows.items()}
    left, chosen = set(mortal), []
    while left:
        best = max(mortal, key=lambda k: sum(k in follows[j] or k == j for j in left))
        chosen.append(best)
        left = {j for j in left if best not in follows[j] and best != j}
    return tuple(sorted(chosen))


def _reached(graph: Graph, j: int, mortal: Sequence[int]) -> set[int]:
    """Return the state variables that are not finite in the next sample where variable `j` is not in this one."""
    lost = [False] * len(graph.nodes)
    for k, node in enumerate(graph.nodes):
        if node.function == "argument":
            lost[k] = node.place == (0, j)
        elif node.function in PASSING:
            zero = any(graph.nodes[a].function == "constant" and graph.nodes[a].value == 0 for a in node.arguments)
            lost[k] = any(lost[a] for a in node.arguments) and not (node.function == "mul" and zero)
        elif node.function in ("if", "choose") and _asks_fresh(graph, node.arguments[0]):
            lost[k] = lost[node.arguments[-1]]  # as it is where no probe has seen it yet
        elif node.function == "choose":
            lost[k] = lost[node.arguments[1]] and lost[node.arguments[2]]
    return {k for k in mortal if lost[graph.results[0][k]]}


def _asks_fresh(graph: Graph, k: int) -> bool:
    """Tell whether node `k` is `fresh`, or, as the condition of what a state is otherwise, its opposite."""
    node = graph.nodes[k]
    return (graph.nodes[node.arguments[0]] if node.function == "not" else node).place == (2, 0)

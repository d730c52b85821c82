"""See what a law limits, so that floating point asks each question once.

A compiler for a core without conditional moves of floats makes one branch of a limit, of the flag that tells whether it
acts, and of what follows from it, but only where all three compare the same values. Hence::

    min(max(v, low), high)           one operation, clamp
    its result != v                  outside(v, low, high)
    b + k (clamp(v) - v)             b, unless v is outside; then b + k (beyond(v) - v), the limit it is beyond
    a where not c, else 0            0 where c, else a

The third is anti-windup by back-calculation; it is the same number, because k times 0 adds nothing.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from firmloop.quantize.lower.graph import Graph, Node


def with_limits(graph: Graph) -> Graph:
    """Rewrite the limits of `graph` between constants."""
    nodes: list[Node] = []
    place: dict[int, int] = {}  # of each node of `graph` in `nodes`
    known: dict[tuple[str, tuple[int, ...], tuple[int, int]], int] = {}

    def add(node: Node) -> int:
        key = (node.function, node.arguments, node.place)
        if node.arguments and key in known:
            return known[key]
        nodes.append(node)
        known[key] = len(nodes) - 1
        return len(nodes) - 1

    for k, old in enumerate(graph.nodes):
        node = replace(old, arguments=tuple(place[a] for a in old.arguments))
        if node.function == "if" and nodes[node.arguments[0]].function == "not":
            zero = add(Node("constant", (), 0.0, (0, 0)))
            (asked,) = nodes[node.arguments[0]].arguments
            node = Node("choose", (asked, zero, node.arguments[1]), 0.0, (0, 0))
        new = _rewritten(nodes, node)
        if new.function == "clamp":  # asked first: whoever does not ask leaves it out
            add(Node("outside", new.arguments, 0.0, (0, 0)))
        place[k] = add(new)
        addend = _unlimited_part(nodes, node)
        if addend is not None:
            kept, product, limited = addend
            outside = add(Node("outside", nodes[limited].arguments, 0.0, (0, 0)))
            total = add(Node("add", (kept, _outside_part(nodes, add, product, limited)), 0.0, (0, 0)))
            place[k] = add(Node("choose", (outside, total, kept), 0.0, (0, 0)))
    return replace(graph, nodes=tuple(nodes), results=tuple(tuple(place[k] for k in row) for row in graph.results))


def _rewritten(nodes: list[Node], node: Node) -> Node:
    if node.function == "min":
        for inner, high in (node.arguments, node.arguments[::-1]):
            if nodes[inner].function != "max" or nodes[high].function != "constant":
                continue
            for v, low in (nodes[inner].arguments, nodes[inner].arguments[::-1]):
                if nodes[low].function == "constant" and nodes[low].value <= nodes[high].value:
                    return Node("clamp", (v, low, high), 0.0, (0, 0))
    if node.function == "ne":
        for limited, v in (node.arguments, node.arguments[::-1]):
            if nodes[limited].function == "clamp" and nodes[limited].arguments[0] == v:
                return Node("outside", nodes[limited].arguments, 0.0, (0, 0))
    return node


def _unlimited_part(nodes: list[Node], node: Node) -> tuple[int, int, int] | None:
    """Return b, k (clamp(v) - v) and the clamp of their sum; None where `node` is something else."""
    if node.function != "add":
        return None
    for kept, product in (node.arguments, node.arguments[::-1]):
        for difference in _factors(nodes, product):
            if nodes[difference].function != "sub":
                continue
            limited, v = nodes[difference].arguments
            if nodes[limited].function == "clamp" and nodes[limited].arguments[0] == v:
                return kept, product, limited
    return None


def _factors(nodes: list[Node], product: int) -> tuple[int, ...]:
    return nodes[product].arguments if nodes[product].function == "mul" else (product,)


def _outside_part(nodes: list[Node], add: Callable[[Node], int], product: int, limited: int) -> int:
    """Return k (beyond(v) - v), given k (clamp(v) - v) and its clamp."""
    difference = Node("sub", (limited, nodes[limited].arguments[0]), 0.0, (0, 0))
    beyond = add(Node("beyond", nodes[limited].arguments, 0.0, (0, 0)))
    part = add(replace(difference, arguments=(beyond, difference.arguments[1])))
    if nodes[product].function != "mul":
        return part
    factors = [part if nodes[a] == difference else a for a in nodes[product].arguments]
    return add(Node("mul", tuple(factors), 0.0, (0, 0)))

"""Gather what a law adds up: every value that must be computed, as one weighted sum of values computed before it.

A law writes kp (b r - y) + I; a processor with a 64-bit accumulator computes that as one sum of products, rounded
once. Computed are: states, outputs and flags; what enters anything but a sum (a limit, a comparison, a choice, a
product of two values); what is used SHARED times or more; and a turned vector, two values times a sine and a cosine,
that is taken by anything but a power of two: it is rounded once. All sums in between are multiplied out exactly.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction

from firmloop.quantize.lower.graph import Graph

LINEAR = ("add", "sub", "neg", "twice")
WAVES = ("sin", "cos")
NEAR_ONE = Fraction(1, 8)
SHARED = 3  # uses from which computing a sum once is cheaper than multiplying it out


@dataclass(frozen=True, slots=True)
class Sum:
    """`constant` plus weight times node, for each of `terms`."""

    constant: Fraction
    terms: Mapping[int, Fraction]


def gather(graph: Graph) -> Mapping[int, Sum]:
    """Return the sum of every linear node that is to be computed; what is in no sum's terms is not needed at all."""
    wanted = _wanted(graph)
    sums: dict[int, Sum] = {}
    for k, node in enumerate(graph.nodes):
        if node.function == "constant":
            sums[k] = Sum(Fraction(node.value), {})
        elif is_linear(graph, k):
            parts = [sums[a] if _open(graph, a, wanted) else Sum(Fraction(0), {a: Fraction(1)}) for a in node.arguments]
            sums[k] = _combined(node.function, parts)
    return {k: total for k, total in sums.items() if k in wanted and graph.nodes[k].function != "constant"}


def is_linear(graph: Graph, k: int) -> bool:
    """Tell whether node `k` is a sum of others, or a product with a constant."""
    node = graph.nodes[k]
    if node.function == "mul":
        return any(_constant(graph, a) for a in node.arguments)
    return node.function in LINEAR


def near_one(weight: Fraction) -> bool:
    """Tell whether a weight is better written as 1 and the rest: then the rest is known to more places."""
    return weight != 1 and abs(weight - 1) <= NEAR_ONE


def _open(graph: Graph, k: int, wanted: set[int]) -> bool:
    return graph.nodes[k].function == "constant" or (is_linear(graph, k) and k not in wanted)


def _wanted(graph: Graph) -> set[int]:
    """Return the nodes that are computed."""
    wanted = {k for row in graph.results[:3] for k in row}
    uses = [0] * len(graph.nodes)
    for k, node in enumerate(graph.nodes):
        for a in node.arguments:
            uses[a] += 1
        if not is_linear(graph, k):
            wanted.update(node.arguments)
    shared = {k for k, count in enumerate(uses) if count >= SHARED}
    return wanted | shared | {k for k in range(len(graph.nodes)) if _turned(graph, k) and not _doubled(graph, k)}


def _turned(graph: Graph, k: int) -> bool:
    """Tell whether a node is a sum of two products, each with a sine or cosine."""
    node = graph.nodes[k]
    return node.function in ("add", "sub") and all(
        graph.nodes[a].function == "mul" and any(graph.nodes[b].function in WAVES for b in graph.nodes[a].arguments)
        for a in node.arguments
    )


def _doubled(graph: Graph, k: int) -> bool:
    """Tell whether all that takes a node are products with a power of two: a shift at its end."""
    takers = [node for node in graph.nodes if k in node.arguments]
    others = [graph.nodes[a] for node in takers if node.function == "mul" for a in node.arguments if a != k]
    powers = [node for node in others if node.function == "constant" and abs(math.frexp(node.value)[0]) == 0.5]
    return len(takers) == len(powers)


def _constant(graph: Graph, k: int) -> bool:
    """Tell whether node `k` follows from constants alone."""
    node = graph.nodes[k]
    if node.function == "constant":
        return True
    return node.function in (*LINEAR, "mul") and all(_constant(graph, a) for a in node.arguments)


def _combined(function: str, parts: list[Sum]) -> Sum:
    match function:
        case "mul":
            factor, other = (parts[0], parts[1]) if not parts[0].terms else (parts[1], parts[0])
            return _scaled(other, factor.constant)
        case "neg":
            return _scaled(parts[0], Fraction(-1))
        case "twice":
            return _scaled(parts[0], Fraction(2))
    sign = 1 if function == "add" else -1
    terms = dict(parts[0].terms)
    for k, weight in parts[1].terms.items():
        terms[k] = terms.get(k, Fraction(0)) + sign * weight
    return Sum(parts[0].constant + sign * parts[1].constant, {k: weight for k, weight in terms.items() if weight})


def _scaled(total: Sum, factor: Fraction) -> Sum:
    return Sum(total.constant * factor, {k: weight * factor for k, weight in total.terms.items() if weight * factor})

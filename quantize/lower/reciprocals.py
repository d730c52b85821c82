"""Write a quotient as a product: fixed point divides once by each value, and by no constant."""

from __future__ import annotations

from dataclasses import replace

from firmloop.quantize.lower.graph import Graph, Node


def with_reciprocals(graph: Graph) -> Graph:
    """Return the graph with a/b as a times 1/b, the latter once for each b; a number where b is a constant."""
    nodes: list[Node] = []
    place: list[int] = []
    known: dict[int, int] = {}  # of 1/b, by the place of b

    def add(node: Node) -> int:
        nodes.append(node)
        return len(nodes) - 1

    def over(b: int) -> int:
        if nodes[b].function == "constant" and nodes[b].value != 0.0:
            return add(Node("constant", (), 1.0 / nodes[b].value, (0, 0)))
        if b not in known:
            known[b] = add(Node("div", (add(Node("constant", (), 1.0, (0, 0))), b), 0.0, (0, 0)))
        return known[b]

    for node in graph.nodes:
        moved = replace(node, arguments=tuple(place[a] for a in node.arguments))
        if node.function == "div":
            above, below = moved.arguments
            one = nodes[above].function == "constant" and nodes[above].value == 1.0
            found = over(below)
            place.append(found if one else add(Node("mul", (above, found), 0.0, (0, 0))))
        else:
            place.append(add(moved))
    return replace(graph, nodes=tuple(nodes), results=tuple(tuple(place[k] for k in row) for row in graph.results))

"""Make one branch of what the first sample does otherwise, and a short one.

The law of a first sample is the law of every sample with another state, and there much of it is nothing: a difference
of equals, what is multiplied by it and added. So the choice is not made of the state but of what follows from it, as
far as the first sample needs no operation of its own for it::

    d = w - (fresh ? w : w_last)                    v = fresh ? p : p + g (w - w_last)
    v = p + g d

All choices then stand together, behind the operations that only the other samples need.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from firmloop.quantize.lower.graph import Graph, Node, pruned

FRESH = (2, 0)  # place of the argument that asks for the first sample


@dataclass(frozen=True, slots=True)
class _Pair:
    """A node in the first sample, and in every other."""

    first: int
    then: int


def merged(graph: Graph) -> Graph:
    """Leave out nodes that say what an earlier one says."""
    nodes: list[Node] = []
    known: dict[Node, int] = {}
    place: list[int] = []
    for old in graph.nodes:
        node = replace(old, arguments=tuple(place[a] for a in old.arguments))
        if node not in known:
            known[node] = len(nodes)
            nodes.append(node)
        place.append(known[node])
    return replace(graph, nodes=tuple(nodes), results=tuple(tuple(place[k] for k in row) for row in graph.results))


def in_one_branch(graph: Graph) -> Graph:
    """Move the choices of the first sample behind what follows from them; unchanged where one needs another."""
    walk = _Walk()
    for node in graph.nodes:
        walk.place.append(walk.placed(node))
    results = tuple(tuple(walk.whole(walk.place[k]) for k in row) for row in graph.results)
    found = pruned(replace(graph, nodes=tuple(walk.nodes), results=results))
    behind = _behind(found)
    choices = [k for k, node in enumerate(found.nodes) if _is_choice(found, node)]
    if any(behind[a] for k in choices for a in found.nodes[k].arguments):
        return graph
    early = _early(found, choices)
    groups = [2 if k in choices else 3 if behind[k] else 0 if k in early else 1 for k in range(len(found.nodes))]
    order = sorted(range(len(found.nodes)), key=lambda k: groups[k])
    new = {k: j for j, k in enumerate(order)}
    nodes = tuple(replace(found.nodes[k], arguments=tuple(new[a] for a in found.nodes[k].arguments)) for k in order)
    return replace(found, nodes=nodes, results=tuple(tuple(new[k] for k in row) for row in found.results))


@dataclass(slots=True)
class _Walk:
    """New nodes, each once, and where each old one is among them."""

    nodes: list[Node] = field(default_factory=list)
    known: dict[Node, int] = field(default_factory=dict)
    place: list[int | _Pair] = field(default_factory=list)
    fresh: int = -1

    def add(self, node: Node) -> int:
        if node not in self.known:
            self.known[node] = len(self.nodes)
            self.nodes.append(node)
        return self.known[node]

    def whole(self, place: int | _Pair) -> int:
        """Return one node: the choice of both, where they are two."""
        if isinstance(place, int):
            return place
        return self.add(Node("choose", (self.fresh, place.first, place.then), 0.0, (0, 0)))

    def placed(self, node: Node) -> int | _Pair:
        places = [self.place[a] for a in node.arguments]
        if node.function == "argument" and node.place == FRESH:
            self.fresh = self.add(node)
            return self.fresh
        if node.function == "choose" and places[0] == self.fresh:
            first, then = (self._at(place, k) for k, place in enumerate(places[1:]))
            return first if first == then else _Pair(first, then)
        if all(isinstance(place, int) for place in places):
            return self.add(replace(node, arguments=tuple(self._at(place, 1) for place in places)))
        first_of = self._without_operation(node.function, [self._at(place, 0) for place in places])
        if first_of is None:
            return self.add(replace(node, arguments=tuple(self.whole(place) for place in places)))
        return _Pair(first_of, self.add(replace(node, arguments=tuple(self._at(place, 1) for place in places))))

    @staticmethod
    def _at(place: int | _Pair, k: int) -> int:
        return place if isinstance(place, int) else (place.first, place.then)[k]

    def _without_operation(self, function: str, arguments: Sequence[int]) -> int | None:
        """Return the node that is the result already; None where there is none."""
        zero = Node("constant", (), 0.0, (0, 0))
        nothing = [self.nodes[a] == zero for a in arguments]
        match function, nothing:
            case "add", [True, _]:
                return arguments[1]
            case (("add" | "sub"), [_, True]):
                return arguments[0]
            case "sub", _ if arguments[0] == arguments[1]:
                return self.add(zero)
            case "add", _ if self._opposite(*arguments):
                return self.add(zero)
            case (("mul" | "neg" | "twice" | "square"), _) if any(nothing):
                return self.add(zero)
        return self.known.get(Node(function, tuple(arguments), 0.0, (0, 0)))

    def _opposite(self, a: int, b: int) -> bool:
        return any(self.nodes[one] == Node("neg", (other,), 0.0, (0, 0)) for one, other in ((a, b), (b, a)))


def _is_choice(graph: Graph, node: Node) -> bool:
    return node.function == "choose" and graph.nodes[node.arguments[0]].place == FRESH


def _behind(graph: Graph) -> list[bool]:
    """Tell of each node whether it is a choice of the first sample, or follows from one."""
    found: list[bool] = []
    for node in graph.nodes:
        found.append(_is_choice(graph, node) or any(found[a] for a in node.arguments))
    return found


def _early(graph: Graph, choices: Sequence[int]) -> set[int]:
    """Return the nodes that the first sample needs, too."""
    found = {k for row in graph.results for k in row}
    for k in reversed(range(len(graph.nodes))):
        if k in found:
            found.update(graph.nodes[k].arguments[:2] if k in choices else graph.nodes[k].arguments)
    return found

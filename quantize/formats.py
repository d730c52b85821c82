"""Choose one Q format per group of values that meet in a sum or a comparison.

Values that are added, compared, limited or selected against each other must stand in one format anyway; giving the
whole group the format of its largest member makes every alignment shift disappear. A state variable shares the group
of the value that becomes it. Only multiplications lead from one group into another, and there the coefficient carries
the change of format.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from design.law import Law
from quantize.graph import Graph
from quantize.program import QuantizeError

FINEST, COARSEST = 56, -16  # Q range: beyond it a quantity is better given in another unit
SPARE = 1.0 + 2.0**-16  # room for what rounding adds to a bound
Span = tuple[float, float]

MEETING = ("add", "sub", "min", "max", "lt", "le", "eq", "ne")  # operands share a format
KEEPING = ("add", "sub", "min", "max", "neg", "abs", "twice")  # and so does the result
TRUTH = ("lt", "le", "eq", "ne", "and", "or", "not")


@dataclass(frozen=True, slots=True)
class Formats:
    """Fraction bits: of each node of the graph, and of each input and state variable as the program computes it."""

    nodes: tuple[int, ...]
    inputs: tuple[int, ...]
    state: tuple[int, ...]


def fit(low: float, high: float, bits: int) -> int:
    """Return the largest fraction at which [low, high] fits a signed word of `bits`."""
    size = max(abs(low), abs(high))
    if size == 0.0:
        return 0
    fraction = bits - 1 - math.frexp(size)[1]
    while round(size * 2.0**fraction) > 2 ** (bits - 1) - 1:
        fraction -= 1
    return min(fraction, FINEST)


def choose_formats(law: Law, graph: Graph) -> Formats:
    """Return the formats of 32-bit fixed point.

    Raises
    ------
    QuantizeError
        when an input or state has no finite range, or a range is beyond any format.
    """
    for signal in (*law.inputs, *law.state):
        if not (math.isfinite(signal.low) and math.isfinite(signal.high)):
            raise QuantizeError(
                f"{signal.name} has no finite proven range, so no fixed-point format is safe for it: "
                "limit it in the controller (an anti_windup mode, a limit) or use float32"
            )
    spans = _spans(law, graph)
    groups = _Groups(len(graph.nodes))
    for k, node in enumerate(graph.nodes):
        if node.function in MEETING:
            groups.join(*node.arguments)
        if node.function in KEEPING:
            groups.join(k, node.arguments[0])
        if node.function == "if":
            groups.join(k, node.arguments[1])
    places = {node.place: k for k, node in enumerate(graph.nodes) if node.function == "argument"}
    for j, following in enumerate(graph.results[0]):
        if (0, j) in places:
            groups.join(places[0, j], following)
    fractions = _fractions(law, graph, spans, groups)
    nodes = tuple(0 if n.function in TRUTH else fractions[groups.of(k)] for k, n in enumerate(graph.nodes))
    return Formats(
        nodes=nodes,
        inputs=tuple(_argument(places, nodes, 1, j, s.low, s.high) for j, s in enumerate(law.inputs)),
        state=tuple(_argument(places, nodes, 0, j, s.low, s.high) for j, s in enumerate(law.state)),
    )


def _argument(
    places: Mapping[tuple[int, int], int], nodes: Sequence[int], i: int, j: int, low: float, high: float
) -> int:
    place = places.get((i, j))
    return fit(low, high, 32) if place is None else nodes[place]


def _fractions(law: Law, graph: Graph, spans: Sequence[Span], groups: _Groups) -> Mapping[int, int]:
    """Return the fraction of each group: the finest that holds its largest member, but no finer than needed."""
    sizes: dict[int, float] = {}
    constants: dict[int, list[float]] = {}
    computed: set[int] = set()
    starts = dict(enumerate(law.start))
    for k, node in enumerate(graph.nodes):
        group = groups.of(k)
        if node.function in TRUTH:
            continue
        low, high = spans[k]
        sizes[group] = max(sizes.get(group, 0.0), abs(low), abs(high))
        if node.function == "constant":
            constants.setdefault(group, []).append(node.value)
        elif node.function == "argument" and node.place[0] == 0 and law.state[node.place[1]].name not in law.tunable:
            constants.setdefault(group, []).append(starts[node.place[1]])
        else:
            computed.add(group)
    fractions = {}
    for group, size in sizes.items():
        fraction = fit(-size * SPARE, size * SPARE, 32)
        if group not in computed:  # nothing but constants: the coarsest format that holds them exactly
            values = constants[group]
            exact = [f for f in range(0, max(fraction, 0) + 1) if all((v * 2.0**f).is_integer() for v in values)]
            fraction = exact[0] if exact else fraction
        if fraction < COARSEST:
            raise QuantizeError(
                f"a value of the law would need Q{fraction} (units of {2.0**-fraction:g}); "
                "the range of a signal or a gain is too large for fixed point: rescale it or use float32"
            )
        fractions[group] = fraction
    return fractions


class _Groups:
    """Disjoint sets of nodes."""

    def __init__(self, count: int) -> None:
        self.parent = list(range(count))

    def of(self, k: int) -> int:
        while self.parent[k] != k:
            self.parent[k] = self.parent[self.parent[k]]
            k = self.parent[k]
        return k

    def join(self, a: int, *others: int) -> None:
        for b in others:
            self.parent[self.of(b)] = self.of(a)


def _product(a: Span, b: Span) -> Span:
    corners = [0.0 if x == 0.0 or y == 0.0 else x * y for x in a for y in b]
    return min(corners), max(corners)


def _magnitude(a: Span) -> Span:
    return (0.0 if a[0] <= 0.0 <= a[1] else min(abs(a[0]), abs(a[1]))), max(abs(a[0]), abs(a[1]))


_RULES: Mapping[str, Callable[..., Span]] = {
    "add": lambda a, b: (a[0] + b[0], a[1] + b[1]),
    "sub": lambda a, b: (a[0] - b[1], a[1] - b[0]),
    "mul": _product,
    "neg": lambda a: (-a[1], -a[0]),
    "square": lambda a: _product(_magnitude(a), _magnitude(a)),
    "twice": lambda a: (2 * a[0], 2 * a[1]),
    "min": lambda a, b: (min(a[0], b[0]), min(a[1], b[1])),
    "max": lambda a, b: (max(a[0], b[0]), max(a[1], b[1])),
    "abs": _magnitude,
    "if": lambda c, a: (min(a[0], 0.0), max(a[1], 0.0)),
}


def _spans(law: Law, graph: Graph) -> list[Span]:
    """Return the interval of every node while inputs and state keep their ranges."""
    ranges = [[(s.low, s.high) for s in law.state], [(s.low, s.high) for s in law.inputs]]
    spans: list[Span] = []
    for node in graph.nodes:
        if node.function == "constant":
            spans.append((node.value, node.value))
        elif node.function == "argument":
            spans.append(ranges[node.place[0]][node.place[1]])
        elif node.function in TRUTH:
            spans.append((0.0, 1.0))
        else:
            spans.append(_RULES[node.function](*(spans[a] for a in node.arguments)))
    return spans

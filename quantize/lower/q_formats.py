"""Choose one Q format per group of values that meet in a comparison, a limit or a plain sum.

Values that are compared, limited or selected against each other must stand in one format anyway; giving the whole group
the format of its largest member makes every alignment shift disappear. A state variable shares the group of the value
that becomes it, and so does what a sum takes as it is, with weight 1, unless that is so small beside the sum that it
would lose its places. A weight leads from any format into any other.

An input keeps the format of its own word, and may hold every value of it. A state variable may hold all values below
the power of two above its proven range: to be limited there costs one instruction where the limit acts at all.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from firmloop.design.law import Law
from firmloop.identify.signal import Signal
from firmloop.quantize.lower.graph import Graph
from firmloop.quantize.lower.sums import Sum, is_linear, near_one
from firmloop.quantize.program import QuantizeError

FINEST, COARSEST = 56, -16  # Q range: beyond it a quantity is better given in another unit
SPARE = 1.0 + 2.0**-16  # room for what rounding adds to a bound
WIDENED = {16: 15, 32: 0}  # bits to the left for an input of that word: the difference of two still fits 32 bits
MOST_GIVEN = 3  # bits of resolution that a sum may give so that its high word is its value
SMALL = 16  # share of a sum from which a part of it keeps a finer format: at least 4 bits
WORD = 2**31 - 1
Span = tuple[float, float]

MEETING = ("min", "max", "lt", "le", "eq", "ne")  # operands share a format
KEEPING = ("min", "max", "abs")  # and so does the result
CHOOSING = ("if", "choose")
TRUTH = ("lt", "le", "eq", "ne", "and", "or", "not", "capped", "infeasible")
PLANNED = ("solve", "move")  # moves share a format


@dataclass(frozen=True, slots=True)
class Formats:
    """Fraction bits: of each node of the graph, and of each input and state variable as it is stored."""

    nodes: tuple[int, ...]
    inputs: tuple[int, ...]
    state: tuple[int, ...]


def fit(low: float, high: float, bits: int) -> int:
    """Return the largest fraction at which [low, high] fits a signed word of `bits`, FINEST at most.

    Raises QuantizeError where an end is no number.
    """
    size = max(abs(low), abs(high))
    if size == 0.0:
        return 0
    if not math.isfinite(size):
        raise QuantizeError(
            "a value of the law would leave all numbers; the range of a signal or a gain is too large: rescale it"
        )
    fraction = min(bits - 1 - math.frexp(size)[1], FINEST)
    while round(size * 2.0**fraction) > 2 ** (bits - 1) - 1:
        fraction -= 1
    return fraction


def held_range(law: Law, signal: Signal) -> Span:
    """Return what a state variable may hold: below the next power of two, or a parameter's declared range."""
    if signal.name in law.tunable:
        return signal.low, signal.high
    size = max(abs(signal.low), abs(signal.high))
    power = 2.0 ** math.frexp(size)[1]
    return -power, power


def choose_formats(law: Law, graph: Graph, sums: Mapping[int, Sum], bits: int) -> Formats:
    """Return the formats of fixed point; `bits` is the word of an input, `sums` what is computed as one sum.

    Raises
    ------
    QuantizeError
        when an input or state has no finite range, or a range is beyond any format.
    """
    for signal in (*law.inputs, *law.state):
        if not (math.isfinite(signal.low) and math.isfinite(signal.high)):
            why = f" ({law.reasons[signal.name]})" if signal.name in law.reasons else ""
            what = "state" if signal in law.state else "input"
            raise QuantizeError(
                f"{what} {signal.name} has no finite proven range{why}, so no fixed-point format is safe for it: "
                'limit it so, or take number = "float32" in [arithmetic]'
            )
    inputs = tuple(fit(s.low, s.high, bits) for s in law.inputs)
    for signal, q in zip(law.inputs, inputs, strict=True):
        _check(q, signal.name)
    words = [(-(2.0 ** (bits - 1 - q)), 2.0 ** (bits - 1 - q)) for q in inputs]
    spans = _spans(graph, sums, [[held_range(law, s) for s in law.state], words, [(0.0, 1.0)]])
    fractions = _Choice(law, graph, sums, spans, [q + WIDENED[bits] for q in inputs], WIDENED[bits]).fractions()
    places = {node.place: k for k, node in enumerate(graph.nodes) if node.function == "argument"}
    state = tuple(
        fractions[places[0, j]] if (0, j) in places else fit(*held_range(law, s), 32) for j, s in enumerate(law.state)
    )
    return Formats(fractions, inputs, state)


def _check(fraction: int, name: str) -> None:
    if fraction < COARSEST:
        raise QuantizeError(
            f"{name} would need Q{fraction} (units of {2.0**-fraction:g}); "
            "the range of a signal or a gain is too large for fixed point: rescale it or use float32"
        )


class _Choice:
    """The groups of one law, and the fraction of each."""

    def __init__(
        self,
        law: Law,
        graph: Graph,
        sums: Mapping[int, Sum],
        spans: Sequence[Span],
        inputs: Sequence[int],
        widened: int,
    ) -> None:
        self.law, self.graph, self.sums, self.spans, self.inputs = law, graph, sums, spans, inputs
        self.widened = widened  # bits that an input is shifted to the left
        self.held = {k for k in range(len(graph.nodes)) if k in sums or not is_linear(graph, k)}
        constants = {k for k, node in enumerate(graph.nodes) if node.function == "constant"}
        self.held -= constants
        self.groups = _Groups(len(graph.nodes))
        self.beside: list[tuple[int, float]] = []  # a value, and a constant that it meets; one constant may meet many
        for k, node in enumerate(graph.nodes):
            if node.function in (*MEETING, *KEEPING, *CHOOSING):
                meeting = list(node.arguments[1:] if node.function in CHOOSING else node.arguments)
                values = [a for a in meeting if a not in constants]
                self.groups.join(*([k] if node.function not in TRUTH else []), *values)
                self.beside += [(values[0] if values else k, graph.nodes[a].value) for a in meeting if a in constants]
            if node.function == "move":
                self.groups.join(k, node.arguments[0])
        for k, total in sums.items():
            plain = [a for a, weight in total.terms.items() if abs(weight) == 1]
            least = max(map(abs, spans[k])) / SMALL
            plain = [a for a in plain if max(map(abs, spans[a])) > least]
            self.groups.join(k, *(a for a in plain if not self._input(a)))
        places = {node.place: k for k, node in enumerate(graph.nodes) if node.function == "argument"}
        for j, following in enumerate(graph.results[0]):
            if (0, j) in places:
                self.groups.join(places[0, j], following)

    def fractions(self) -> tuple[int, ...]:
        """Return the fraction of every node."""
        finest = self._finest()
        natural = dict(finest)
        before: dict[int, list[int]] = {}  # of a group's sums
        for k in self.sums:  # in the order of computing: what a sum reads has its format before it
            group = self.groups.of(k)
            before.setdefault(group, []).append(k)
            for bits in range(natural[group] - finest[group], MOST_GIVEN + 1):
                tried = {**finest, group: natural[group] - bits}
                if all(self._high_word(j, tried) for j in before[group]):
                    finest = tried
                    break
        for fraction in finest.values():
            _check(fraction, "a value of the law")
        return tuple(
            0 if node.function in TRUTH else finest.get(self.groups.of(k), 0) for k, node in enumerate(self.graph.nodes)
        )

    def _finest(self) -> dict[int, int]:
        """Return the finest fraction at which each group's largest member fits, but no finer than needed."""
        sizes: dict[int, float] = {}
        constants: dict[int, list[float]] = {}
        computed: set[int] = set()
        made: set[int] = set()  # groups with a value that an operation or a state gives
        read: dict[int, int] = {}  # groups with an input
        for k, value in self.beside:
            if k in self.held:
                constants.setdefault(self.groups.of(k), []).append(value)
        for group, values in constants.items():
            sizes[group] = max(map(abs, values))
        for k, node in enumerate(self.graph.nodes):
            group = self.groups.of(k)
            if k not in self.held:
                continue
            low, high = (0.0, 0.0) if node.function in TRUTH else self.spans[k]
            sizes[group] = max(sizes.get(group, 0.0), abs(low), abs(high))
            if self._input(k):
                read[group] = min(self.inputs[node.place[1]], read.get(group, FINEST))
            else:
                made.add(group)
            if (
                node.function == "argument"
                and node.place[0] == 0
                and self.law.state[node.place[1]].name not in self.law.tunable
            ):
                constants.setdefault(group, []).append(self.law.start[node.place[1]])
            else:
                computed.add(group)
        fractions = {}
        for group, size in sizes.items():
            fraction = fit(-size * SPARE, size * SPARE, 32)
            if group in read and group not in made:  # nothing is rounded: an input keeps its whole word
                most = max((abs(value) for value in constants.get(group, ())), default=0.0)
                fraction = min(read[group], fit(-most, most, 32) if most else FINEST)
            if group not in computed:  # nothing but constants: the coarsest format that holds them exactly
                values = constants[group]
                exact = [f for f in range(0, max(fraction, 0) + 1) if all((v * 2.0**f).is_integer() for v in values)]
                fraction = exact[0] if exact else fraction
            fractions[group] = fraction
        return fractions

    def _high_word(self, k: int, fractions: Mapping[int, int]) -> bool:
        """Tell whether every weight of sum `k` fits a word when the sum is to stand in the high one of two."""
        q = fractions[self.groups.of(k)]
        if all(abs(weight) == 1 for weight in self.sums[k].terms.values()):
            return True  # there is nothing to multiply
        for a, weight in self.sums[k].terms.items():
            own = self.inputs[self.graph.nodes[a].place[1]] if self._input(a) else fractions[self.groups.of(a)]
            if abs(weight) == 1 and own == q:
                continue
            mantissa, exponent = math.frexp(abs(weight))
            if self._input(a) and mantissa == 0.5 and 0 < exponent + q - own + self.widened <= self.widened:
                continue  # a short input is moved by a shift alone
            room = max(0, math.floor(math.log2(WORD / max(1.0, max(map(abs, self.spans[a])) * 2.0**own))))
            if abs(weight) * Fraction(2) ** (32 + q - own - room) > WORD:
                return False
        return True

    def _input(self, k: int) -> bool:
        return self.graph.nodes[k].function == "argument" and self.graph.nodes[k].place[0] == 1


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


def _reciprocal(b: Span) -> Span:
    if b[0] <= 0.0:
        raise QuantizeError(
            f"it divides by a value from {b[0]:g} to {b[1]:g}, which has no fixed-point form: limit that to what is "
            'above 0, or use arithmetic.number = "float32"'
        )
    return 1.0 / b[1], 1.0 / b[0]


def _magnitude(a: Span) -> Span:
    return (0.0 if a[0] <= 0.0 <= a[1] else min(abs(a[0]), abs(a[1]))), max(abs(a[0]), abs(a[1]))


_RULES: Mapping[str, Callable[..., Span]] = {
    "mul": _product,
    "square": lambda a: _product(_magnitude(a), _magnitude(a)),
    "min": lambda a, b: (min(a[0], b[0]), min(a[1], b[1])),
    "max": lambda a, b: (max(a[0], b[0]), max(a[1], b[1])),
    "abs": _magnitude,
    "div": lambda one, b: _reciprocal(b),
    "sin": lambda a: (-1.0, 1.0),
    "cos": lambda a: (-1.0, 1.0),
    "sqrt": lambda a: (math.sqrt(max(a[0], 0.0)), math.sqrt(max(a[1], 0.0))),
    "if": lambda c, a: (min(a[0], 0.0), max(a[1], 0.0)),
    "choose": lambda c, a, b: (min(a[0], b[0]), max(a[1], b[1])),
}


def _size(weight: Fraction) -> float:
    return float(1 + abs(weight - 1) if near_one(weight) else abs(weight))


def _spans(graph: Graph, sums: Mapping[int, Sum], ranges: Sequence[Sequence[Span]]) -> list[Span]:
    """Return the interval of every node that is computed while inputs and state keep their ranges; 0 for the others.

    That of a sum is wide enough for every part of it.
    """
    spans: list[Span] = []
    for k, node in enumerate(graph.nodes):
        if node.function == "constant":
            spans.append((node.value, node.value))
        elif node.function == "argument":
            spans.append(ranges[node.place[0]][node.place[1]])
        elif node.function in TRUTH:
            spans.append((0.0, 1.0))
        elif node.function in PLANNED:
            assert graph.solve is not None
            problem, first = graph.solve.quadratic, len(graph.solve.quadratic.scale)
            spans.append(
                (float(min(problem.low[:first] * problem.scale)), float(max(problem.high[:first] * problem.scale)))
            )
        elif k in sums:
            parts = (_size(w) * max(map(abs, spans[a])) for a, w in sums[k].terms.items())
            size = abs(float(sums[k].constant)) + sum(parts)
            spans.append((-size, size))
        elif node.function in _RULES:
            spans.append(_RULES[node.function](*(spans[a] for a in node.arguments)))
        else:
            spans.append((0.0, 0.0))  # multiplied out
    return spans

"""Show that a value of fixed point keeps a limit, by cutting what it is made of into ever smaller boxes.

Where a value is made of a few others of which one goes in twice, as in x (2 - b x), its range as proven operation by
operation is far too wide: each takes what it reads to be independent. In small boxes of x and b it is not.
"""

from __future__ import annotations

from collections.abc import Mapping

from firmloop.quantize.ops import EVERY, LARGE, as_intervals
from firmloop.quantize.program import Op, Program

LEAVES = 2  # values that boxes are made of
MOST = 200_000  # boxes looked at

Ranges = Mapping[str, tuple[float, float]]
Box = dict[str, tuple[int, int]]


def stays_within(program: Program, ranges: Ranges, value: str, low: float, high: float) -> bool:
    """Tell whether `value` is shown to keep `low` to `high`, all that it is made of being anywhere in `ranges`."""
    chain, leaves = _cone(program, value)
    if not chain or program.arithmetic.startswith("float"):
        return False

    def excess(box: Box) -> float:
        """Return by how much the value may leave the limits, at most."""
        found: dict[str, tuple[float, float]] = dict(box)
        for op in chain:
            terms = [found[a] if isinstance(a, str) else a for a in op.arguments]
            made = EVERY[op.function].bound(*as_intervals(op.function, terms))
            known = ranges[op.result.name]
            found[op.result.name] = max(made[0], known[0]), min(made[1], known[1])
        least, most = found[value]
        return max(low - least, most - high)

    def beyond(boxes: list[Box]) -> list[tuple[float, Box]]:
        """Return the boxes in which the value may leave the limits, with by how much."""
        weighed = [(excess(box), box) for box in boxes]
        return [each for each in weighed if each[0] > 0]

    left = beyond([{name: (int(ranges[name][0]), int(ranges[name][1])) for name in leaves}])
    for _ in range(MOST):
        if not left:
            return True
        _, box = left.pop()
        halves = [beyond(_cut(box, name)) for name in box if box[name][0] < box[name][1]]
        if not halves:
            return False  # one point, which may leave them
        left += min(halves, key=lambda parts: sum(over for over, _ in parts))
    return False


def _cut(box: Box, name: str) -> list[Box]:
    low, high = box[name]
    middle = (low + high) // 2
    return [box | {name: (low, middle)}, box | {name: (middle + 1, high)}]


def _cone(program: Program, value: str) -> tuple[list[Op], list[str]]:
    """Return operations that make a value, in order, and the few values that they start from."""
    place = {op.result.name: k for k, op in enumerate(program.body)}
    leaves, chosen = {value}, set[int]()
    while True:
        for name in sorted(leaves & set(place), key=lambda each: -place[each]):
            op = program.body[place[name]]
            rest = leaves - {name} | {a for a in op.arguments if isinstance(a, str)}
            if op.function not in LARGE and len(rest) <= LEAVES:
                leaves = rest
                chosen.add(place[name])
                break
        else:
            return [program.body[k] for k in sorted(chosen)], sorted(leaves)

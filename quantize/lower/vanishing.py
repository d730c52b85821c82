"""Prove that an infinite state becomes no number by itself: then a controller need only look for the latter.

To ask whether a float is infinite or no number takes one operation more than to ask for the second alone. An integrator
with back-calculation, infinite once, adds infinities of both signs in the next sample; one that is merely held stays
infinite for ever. Which of both a law does is found by running it on sets of values: `FINITE` stands for every finite
number, and what one operation makes of it is seen from one negative, zero and one positive number.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import product

import numpy as np

from firmloop.quantize.lower.graph import MEANING, Graph, Node

FINITE = "finite"
EACH = (-1.0, 0.0, 1.0)  # what stands for a finite number
WITHIN = 3  # samples
MOST = 4  # state variables, and inputs: beyond, the combinations are too many to look at
TRUTHS = ("lt", "le", "eq", "ne", "and", "or", "not")
Element = float | str
Values = frozenset[Element]
Known = dict[tuple[object, ...], Values]


def vanishes(graph: Graph, mortal: Sequence[int], probes: Sequence[int]) -> bool:
    """Tell whether the sum of the state variables `probes` is no number soon after any of `mortal` is not finite.

    Soon is: at once in the sample after an input that is not finite, if any state is lost there, and within `WITHIN`
    samples otherwise.
    """
    inputs = 1 + max((n.place[1] for n in graph.nodes if n.function == "argument" and n.place[0] == 1), default=-1)
    if not probes or len(mortal) > MOST or inputs > MOST or any(_unknown(node) for node in graph.nodes):
        return False
    known: Known = {}
    calm: list[Values] = [frozenset((FINITE,))] * max(inputs, len(graph.results[0]))
    for places in _combinations(range(inputs)):
        after = _stepped(graph, calm, _with(calm, places), known)
        if not _seen(after, probes) and any(after[j] != {FINITE} for j in mortal):
            return False
    return all(_soon(graph, _with(calm, places), calm, probes, known) for places in _combinations(mortal))


def _soon(
    graph: Graph,
    state: list[Values],
    inputs: list[Values],
    probes: Sequence[int],
    known: dict[tuple[object, ...], Values],
) -> bool:
    for _ in range(WITHIN):
        if _seen(state, probes):
            return True
        state = _stepped(graph, state, inputs, known)
    return _seen(state, probes)


def _seen(state: Sequence[Values], probes: Sequence[int]) -> bool:
    """Tell whether one of the probes is no number, whatever the others are: then their sum is none."""
    return any(all(x != x for x in state[k]) for k in probes)


def _combinations(places: Sequence[int]) -> list[Mapping[int, Values]]:
    """Return every choice of what is not finite, at one or more of the places."""
    rows = product((None, math.inf, -math.inf, math.nan), repeat=len(places))
    found = [{k: frozenset((x,)) for k, x in zip(places, row, strict=True) if x is not None} for row in rows]
    return [row for row in found if row]


def _with(calm: Sequence[Values], places: Mapping[int, Values]) -> list[Values]:
    return [places.get(k, values) for k, values in enumerate(calm)]


def _unknown(node: Node) -> bool:
    return node.function not in ("constant", "argument", *MEANING) or node.function in ("capped", "infeasible")


def _stepped(graph: Graph, state: Sequence[Values], inputs: Sequence[Values], known: Known) -> list[Values]:
    """Return the values that the state variables can have after one sample."""
    found: list[Values] = []
    for node in graph.nodes:
        if node.function == "constant":
            found.append(frozenset((node.value,)))
        elif node.function == "argument":
            place, k = node.place
            later = frozenset((0.0,))  # the third argument asks for the first sample: it is another
            found.append(state[k] if place == 0 else inputs[k] if place == 1 else later)
        else:
            arguments = tuple(found[a] for a in node.arguments)
            key = (node.function, *arguments)
            if key not in known:
                known[key] = frozenset().union(*(_result(node.function, row) for row in product(*arguments)))
            found.append(known[key])
    return [found[k] for k in graph.results[0]]


def _result(function: str, row: Sequence[Element]) -> Values:
    if function == "choose":  # what is not chosen does not matter
        return frozenset(row[1:] if row[0] == FINITE else (row[1 if row[0] != 0 else 2],))
    open_ = [x == FINITE for x in row]
    calm = all(x == FINITE or math.isfinite(float(x)) for x in row)
    if any(open_) and calm:
        return frozenset((0.0, 1.0)) if function in TRUTHS else frozenset((FINITE,))
    with np.errstate(all="ignore"):
        meant = [
            float(MEANING[function](*(np.float64(x) for x in numbers)))
            for numbers in product(*(EACH if x == FINITE else (float(x),) for x in row))
        ]
    exact = function in TRUTHS or not any(open_)
    return frozenset(_one_nan(x) if exact or not math.isfinite(x) else FINITE for x in meant)


def _one_nan(x: float) -> float:
    """Return the number; each that is none as the same object, which a set holds once."""
    return math.nan if x != x else x

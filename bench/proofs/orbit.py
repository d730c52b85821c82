"""Tell which state variables never are 0, of those that follow from themselves alone, as a generator of draws does.

A run from where such a state starts tells on which grid it stays. That it stays there for ever is then shown for all
numbers of the grid within its proven range at once: each leads to another one. Where a choice asks for something else,
such as whether a value was lost, both of what it chooses from are followed.
"""

from __future__ import annotations

import math
from dataclasses import replace
from fractions import Fraction
from functools import reduce

import numpy as np
from numpy.typing import NDArray

from firmloop.quantize.program import Assign, Op, Program
from firmloop.verify.reference import Machine, working_type

SAMPLES = 500  # of the run
MOST = 2**21  # numbers of a grid, beyond which it is given up


def away_from_zero(program: Program) -> dict[str, tuple[float, float]]:
    """Return the nearest values to 0 below and above it of each such state variable."""
    found = {}
    for store in program.next_state:
        if store.target not in (program.unset, *program.tunable):
            values = closed_grid(program, store)
            if values is not None and np.all(values != 0):
                below, above = values[values < 0], values[values > 0]
                found[store.target] = float(below.max(initial=-np.inf)), float(above.min(initial=np.inf))
    return found


def closed_grid(program: Program, store: Assign) -> NDArray[np.float64] | None:
    """Return a grid that holds every value that the state `store.target` can have; None where none is found."""
    writers = {op.result.name: op for op in program.body}
    place, kind = f"self.{store.target}", working_type(program)
    sources = _chosen(store.source, place, writers)
    if sources is None:
        return None
    start, held = next((x, v) for v, x in zip(program.state, program.start, strict=True) if v.name == store.target)
    named = [source for source in sources if isinstance(source, str) and source != place]
    steps = [_alone(program, store.target, source, _needs(source, place, writers) or set()) for source in named]
    met = [float(start), *(float(source) for source in sources if not isinstance(source, str))]
    with np.errstate(all="ignore"):
        for step in steps:
            for _ in range(SAMPLES):
                met.append(float(step.step([], [np.array([met[-1]], dtype=kind)])[step.next[0]][0]))
        if not np.all(np.isfinite(met)) or len(set(met)) == 1:
            return None
        apart = float(reduce(_common, (Fraction(x) - Fraction(met[0]) for x in met)))
        first, last = math.ceil((held.low - met[0]) / apart), math.floor((held.high - met[0]) / apart)
        if last - first >= MOST:
            return None
        grid = met[0] + apart * np.arange(first, last + 1)
        after = [np.array(met), *(step.step([], [grid.astype(kind)])[step.next[0]] for step in steps)]
    exact = np.all(grid.astype(kind) == grid)
    return grid if exact and all(np.all(np.isin(values, grid)) for values in after) else None


def _common(one: Fraction, other: Fraction) -> Fraction:
    """Return the largest number of which both are multiples."""
    below = math.lcm(one.denominator, other.denominator)
    return Fraction(math.gcd(int(one * below), int(other * below)), below)


def _chosen(source: str | float, place: str, writers: dict[str, Op]) -> list[str | float] | None:
    """Return what a value is one of: constants, and values that follow from the state alone."""
    if not isinstance(source, str) or _needs(source, place, writers) is not None:
        return [source]
    op = writers.get(source)
    if op is None or op.function not in ("select", "copy"):
        return None
    found: list[str | float] = []
    for argument in op.arguments[1:] if op.function == "select" else op.arguments:
        chosen = _chosen(argument, place, writers)
        if chosen is None:
            return None
        found += chosen
    return found


def _needs(source: str, place: str, writers: dict[str, Op]) -> set[str] | None:
    """Return the operations that a value takes, if it follows from the state at `place` alone."""
    if source == place:
        return set()
    if source not in writers:
        return None
    found = {source}
    for argument in writers[source].arguments:
        needs = _needs(argument, place, writers) if isinstance(argument, str) else set()
        if needs is None:
            return None
        found |= needs
    return found


def _alone(program: Program, state: str, source: str, needs: set[str]) -> Machine:
    """Return the machine that computes only what the next value of the state takes."""
    kept = tuple(op for op in program.body if op.result.name in needs)
    held = tuple(value for value in program.state if value.name == state)
    start = tuple(x for value, x in zip(program.state, program.start, strict=True) if value.name == state)
    alone = replace(program, inputs=(), outputs=(), state=held, start=start, body=kept, tables=(), routines=())
    return Machine(replace(alone, next_state=(Assign(state, source),), results=(), status=(), safe=(), tunable=()))

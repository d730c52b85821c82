"""Follow what the values of a fixed-point program may be in one step from a state that holds anything.

A value is harmed that may leave its word, or, as an output or a next state, its range; or on the way to which a part
of the C expression may. What an operation over a table computes, or one whose C has a file of its own, is proven for
the ranges of what it reads, so what reads more than that is harmed too.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass

from firmloop.quantize.ops import EVERY, LARGE, Interval, as_intervals
from firmloop.quantize.program import Op, Program

LEAST, WORD = -(2**31), 2**31 - 1


@dataclass(frozen=True, slots=True)
class FreeState:
    """The raw range of every value that an operation gives, up to the one that is harmed; empty: none is."""

    ranges: Mapping[str, tuple[int, int]]
    harmed: str


def free_state(program: Program, free: Collection[str]) -> FreeState:
    """Take one step while the states `free` hold anything, and the others what their range allows."""
    usual: dict[str, Interval] = {f"self.{v.name}": (v.low, v.high) for v in program.state}
    usual |= {op.result.name: (op.result.low, op.result.high) for op in program.body}
    known: dict[str, Interval] = {f"in.{v.name}": _whole(v.number.bits) for v in program.inputs}
    known |= {f"self.{v.name}": _whole(32) if v.name in free else (v.low, v.high) for v in program.state}
    found: dict[str, tuple[int, int]] = {}
    for op in program.body:
        name = op.result.name
        if op.function in LARGE or EVERY[op.function].support:
            read = [a for a in op.arguments if isinstance(a, str) and a in usual]
            fits = all(usual[a][0] <= known[a][0] and known[a][1] <= usual[a][1] for a in read)
            known[name] = usual[name]
        else:
            given = [known[a] if isinstance(a, str) else a for a in op.arguments]
            low, high = known[name] = EVERY[op.function].bound(*as_intervals(op.function, given))
            least, most = _whole(op.result.number.bits)
            fits = least <= low and high <= most and _inner_fits(op, given)
        if not fits:
            return FreeState(found, name)
        found[name] = int(known[name][0]), int(known[name][1])
    values = (*program.state, *program.outputs)
    for value, store in zip(values, (*program.next_state, *program.results), strict=True):
        low, high = known[store.source]
        if low < value.low or high > value.high:
            return FreeState(found, store.source)
    return FreeState(found, "")


def _inner_fits(op: Op, given: list[Interval | int | float]) -> bool:
    """Tell whether what the C computes on the way to the result fits 32 bits."""
    if op.function not in ("shr", "high", "mul_shift"):
        return True
    *factors, (shift, _) = [x if isinstance(x, tuple) else (x, x) for x in given]
    low, high = EVERY["wide"].bound(*factors) if len(factors) == 2 else factors[0]
    if op.function == "shr":
        return bool(high + 2 ** (int(shift) - 1) <= WORD)
    return int(low) >> int(shift) >= LEAST  # rounded down before it is rounded to nearest


def _whole(bits: int) -> Interval:
    return -(2 ** (bits - 1)), 2 ** (bits - 1) - 1

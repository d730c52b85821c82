"""Prove the operations over tables of a fixed-point program a second time, from proof.json alone, in whole numbers.

Nothing of the prover is used: this file knows the C of fl_sweeps_i32.h and fl_tree_i32.h, line by line, and bounds each
sum there by the sum of the largest magnitudes of its parts, which no order of adding can exceed. What the C limits is
bounded by the limits. Every sum of 64 bits, every value cut to 32, and every intermediate in between must fit its type;
and a tree must lead to a law from every node within its depth.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

INT16, INT32, INT64 = 2**15 - 1, 2**31 - 1, 2**63 - 1
SWEEPS = ("FL_QP_ROWS", "FL_QP_WIDTH", "FL_QP_PARAMETERS", "FL_QP_MOVES", "FL_SWEEPS")
SWEEPS_SHIFTS = ("FL_SHIFT_SLOPE", "FL_SHIFT_PUSH", "FL_SHIFT_MIX", "FL_SHIFT_SCALE")
TREE = ("FL_QP_PARAMETERS", "FL_QP_MOVES", "FL_TREE_NODES", "FL_TREE_LAWS", "FL_TREE_DEPTH")
TREE_SHIFTS = ("FL_SHIFT_LAW",)


def check_sweeps(table: Mapping[str, Any], parameters: Sequence[tuple[int, int]], claimed: tuple[int, int]) -> str:
    """Return what is wrong, with the number; empty where every value fits and every move is within `claimed`."""
    sizes, numbers = table["sizes"], table["numbers"]
    wrong = _sizes(sizes, SWEEPS, SWEEPS_SHIFTS)
    if wrong:
        return wrong
    rows, count, moves = sizes["FL_QP_ROWS"], sizes["FL_QP_PARAMETERS"], sizes["FL_QP_MOVES"]
    lengths = {"slope": rows * count, "push": rows * count, "mix": sizes["FL_QP_WIDTH"] * rows, "low": rows}
    lengths |= {"high": rows, "scale": moves, "least": moves, "most": moves, "reach": None, "tolerance": None}
    wrong = _numbers(numbers, lengths)
    if wrong:
        return wrong
    if moves > rows or sizes["FL_QP_WIDTH"] < max(rows, 3) or sizes["FL_QP_WIDTH"] % 2:
        return f"{moves} moves, {rows} rows and a width of {sizes['FL_QP_WIDTH']} do not belong together"
    reach = numbers["reach"]
    largest = [max(abs(low), abs(high)) for low, high in parameters]
    if len(largest) != count:
        return f"{len(largest)} parameters and a table for {count} do not belong together"
    if reach <= 0:
        return f"reach is {reach}, not above 0"
    found: list[tuple[str, int, int]] = []
    ends = [(max(low, -reach), min(high, reach)) for low, high in zip(numbers["low"], numbers["high"], strict=True)]
    # s <= low: c = low and 2 c - s is from low to 2 low + reach; s >= high: from 2 high - reach to high; else it is s
    mirrored = [max(abs(low), abs(high), abs(2 * low + reach), abs(2 * high - reach)) for low, high in ends]
    for i in range(rows):
        free = _sum(numbers["slope"][i * count : (i + 1) * count], largest) + _half(sizes["FL_SHIFT_SLOPE"])
        pushed = _sum(numbers["push"][i * count : (i + 1) * count], largest) + _half(sizes["FL_SHIFT_PUSH"])
        mixed = _sum(numbers["mix"][i * rows : (i + 1) * rows], mirrored) + _half(sizes["FL_SHIFT_MIX"])
        push = _shifted(pushed, sizes["FL_SHIFT_PUSH"])
        y = push + _shifted(mixed, sizes["FL_SHIFT_MIX"])
        c = max(abs(x) for x in ends[i])
        step = 7 * (y + c) + 2
        found += [
            ("slope p", free, INT64), ("push p", pushed, INT64), ("mix x", mixed, INT64), ("push", push, INT32),
            ("2 c", 2 * c, INT32), ("2 c - s", mirrored[i], INT32), ("y", y, INT32), ("7 (y - c) + 2", step, INT32),
            ("s + 7/4 (y - c)", reach + _shifted(step, 2), INT32),
        ]  # fmt: skip
        if not -reach <= numbers["low"][i] <= numbers["high"][i] <= reach:
            return f"the limits of row {i} are not in order within reach"
    for k in range(sizes["FL_QP_MOVES"]):
        c = max(abs(x) for x in ends[k])
        found.append(("c scale", c * abs(numbers["scale"][k]) + _half(sizes["FL_SHIFT_SCALE"]), INT64))
    return _moves(numbers, claimed) or _first(found)


def check_tree(table: Mapping[str, Any], parameters: Sequence[tuple[int, int]], claimed: tuple[int, int]) -> str:
    """Return what is wrong, with the number; empty where every value fits, every way ends, and moves are `claimed`."""
    sizes, numbers = table["sizes"], table["numbers"]
    wrong = _sizes(sizes, TREE, TREE_SHIFTS)
    if wrong:
        return wrong
    width, moves, nodes = sizes["FL_QP_PARAMETERS"] + 1, sizes["FL_QP_MOVES"], sizes["FL_TREE_NODES"]
    lengths = {"plane": nodes * width, "law": sizes["FL_TREE_LAWS"] * moves * width}
    wrong = _numbers(numbers, lengths | {"least": moves, "most": moves, "below": nodes, "above": nodes})
    if wrong:
        return wrong
    largest = [*(max(abs(low), abs(high)) for low, high in parameters), 1 << 30]
    plane, law = numbers["plane"], numbers["law"]
    if max(nodes, sizes["FL_TREE_LAWS"]) > INT16:
        return f"{nodes} nodes and {sizes['FL_TREE_LAWS']} laws; the C counts them in 16 bits"
    if len(largest) != width:
        return f"{len(largest) - 1} parameters and a table for {width - 1} do not belong together"
    longest = [1] * sizes["FL_TREE_NODES"]
    for k in reversed(range(len(longest))):
        for child in (numbers["below"][k], numbers["above"][k]):
            if not (k < child < len(longest) or -sizes["FL_TREE_LAWS"] <= child < 0):
                return f"node {k} leads to {child}, which is no later node and no law"
            longest[k] = max(longest[k], 1 + (longest[child] if child >= 0 else 0))
    if longest[0] > sizes["FL_TREE_DEPTH"]:
        return f"a way through the tree has {longest[0]} nodes, more than {sizes['FL_TREE_DEPTH']}"
    half = _half(sizes["FL_SHIFT_LAW"])
    found = [("a plane", _sum(plane[k : k + width], largest), INT64) for k in range(0, len(plane), width)]
    found += [("a law", _sum(law[k : k + width], largest) + half, INT64) for k in range(0, len(law), width)]
    return _moves(numbers, claimed) or _first(found)


def _sizes(sizes: Mapping[str, Any], names: Sequence[str], shifts: Sequence[str]) -> str:
    """Return which size is missing or below 1, or which shift is none of a 64-bit sum."""
    for name in (*names, *shifts):
        most = 63 if name in shifts else INT32
        if not 1 <= sizes.get(name, 0) <= most:
            return f"{name} is {sizes.get(name, 'missing')}, it must be from 1 to {most}"
    return ""


def _numbers(numbers: Mapping[str, Any], lengths: Mapping[str, int | None]) -> str:
    """Return which member is missing, has another length than its array, or is not whole; None is a single number."""
    for name, length in lengths.items():
        found = numbers.get(name)
        values = found if isinstance(found, list) else [found]
        if isinstance(found, list) != (length is not None) or len(values) != (1 if length is None else length):
            return f"{name} has {len(values)} numbers where {length or 1} are read: they do not belong together"
        if not all(isinstance(x, int) and abs(x) <= INT32 for x in values):
            return f"a number of the table is not within 32 bits, in {name}"
    return ""


def _moves(numbers: Mapping[str, Any], claimed: tuple[int, int]) -> str:
    for k, (least, most) in enumerate(zip(numbers["least"], numbers["most"], strict=True)):
        if not claimed[0] <= least <= most <= claimed[1]:
            return f"move {k} may be {least} to {most}, its range is {claimed}"
    return ""


def _first(found: Sequence[tuple[str, int, int]]) -> str:
    return next((f"{name} may reach {size}, beyond {most}" for name, size, most in found if size > most), "")


def _sum(row: Sequence[int], largest: Sequence[int]) -> int:
    return sum(abs(a) * b for a, b in zip(row, largest, strict=True))


def _half(shift: int) -> int:
    return 1 << (shift - 1)


def _shifted(size: int, shift: int) -> int:
    """Return the largest magnitude of a value up to `size` shifted to the right: downward it may be 1 more."""
    return (size >> shift) + 1

"""State by how many places each operation may shift: never by its word's width or more, which C leaves undefined.

A value that would have to move 32 places or more to the right is at most half a unit of where it goes: rounded to
nearest it is 0 there, whatever it is. So the lowering never needs such a shift. It leaves the value out, at the cost of
its size, or refuses the law where nothing else is left (`FixedBuilder`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

COUNTS: Mapping[str, tuple[int, int, int]] = {  # the argument that counts, the least and the most it may be
    "shl": (1, 0, 30),  # 2**31 is no factor of 32 bits
    "shr": (1, 1, 30),
    "asr": (1, 1, 31),
    "wrap": (1, 1, 31),
    "high": (1, 1, 62),
    "high_down": (1, 1, 62),
    "mul_shift": (2, 1, 62),
    "mul_down": (2, 1, 62),
    "turn": (2, 1, 32),
    "whole_root": (1, 1, 31),
    "inverse": (1, 0, 15),  # its other count has the same limits: where it is too large, the value does not fit
}
SIZES = ("FL_SHIFT_", 1, 62)  # how a table names its counts, all behind sums of 64 bits


def wrong_count(function: str, arguments: Sequence[object]) -> str:
    """Say what is wrong with the count of a shift; "" where nothing is, or where nothing is shifted."""
    if function not in COUNTS:
        return ""
    place, least, most = COUNTS[function]
    count = arguments[place]
    if isinstance(count, int) and least <= count <= most:
        return ""
    return f"{function} shifts by {least} to {most} places, not by {count}"


def wrong_sizes(sizes: Sequence[tuple[str, int]]) -> str:
    """Say which count of a table's own shifts is out of its word; "" where none is."""
    name, least, most = SIZES
    wrong = [f"{key} = {count}" for key, count in sizes if key.startswith(name) and not least <= count <= most]
    return f"a table shifts by {least} to {most} places, not by {', '.join(wrong)}" if wrong else ""

"""Take the one group of vectors that a file of several is read for, or say which there are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from firmloop.identify.recordings.extent import MOST_BYTES, is_too_large
from firmloop.identify.recordings.table import Misread, RawTable, table_of_arrays

_SAME = 1e-3  # of a step: stamps closer than this differ by rounding
_FEWEST = 3  # instants at which all groups have a value
Vector = tuple[str, NDArray[np.generic], str]  # name, values, unit; no unit is empty


@dataclass(frozen=True, slots=True)
class Group:
    """Vectors that a file keeps together, the time first where it is known; `time_s` is then its name."""

    name: str
    vectors: tuple[Vector, ...]

    @property
    def rows(self) -> int:
        """The length of its first vector."""
        return len(self.vectors[0][1])

    @property
    def timed(self) -> bool:
        """Whether its time is known."""
        return self.vectors[0][0] == "time_s"


def table_of_groups(groups: Sequence[Group], remedy: str) -> RawTable | Misread:
    """Return the only group as a table; `remedy` says how to save one.

    Groups of one measurement are one: those that share their time, and those with different names whose times overlap.
    """
    held, late = _at_one_rate(_merged([group for group in groups if len(group.vectors) > 1]))
    if not held:
        return Misread("", "holds no numeric vectors beside one another", remedy)
    if len(held) > 1:
        said = "; ".join(
            f"{each.name or 'at its top'}: {each.rows:,} rows of {', '.join(name for name, _, _ in each.vectors)[:60]}"
            for each in held[:6]
        )
        more = f" and {len(held) - 6} more" if len(held) > 6 else ""
        return Misread("", f"holds {len(held)} tables, each with rows of its own ({said}{more})", remedy)
    (only,) = held
    table = table_of_arrays(tuple((name, values) for name, values, _ in only.vectors))
    if isinstance(table, Misread):
        return table
    units = tuple(unit for name, _, unit in only.vectors if name in table.names)
    if 8 * only.rows * len(only.vectors) > MOST_BYTES:
        return is_too_large(8 * only.rows * len(only.vectors))
    notes = (late,) if late else (f"is read from its group {only.name}",) if only.name else ()
    return replace(table, units=units if any(units) else (), notes=(*notes, *table.notes))


def _merged(groups: Sequence[Group]) -> list[Group]:
    """Put groups together that have the same time and no other name in common."""
    found: list[Group] = []
    for group in groups:
        twin = next((k for k, other in enumerate(found) if _same_time(group, other)), None)
        if twin is None:
            found.append(group)
        else:
            found[twin] = replace(found[twin], vectors=(*found[twin].vectors, *group.vectors[1:]))
    return found


def _same_time(one: Group, other: Group) -> bool:
    shared = {name for name, _, _ in one.vectors[1:]} & {name for name, _, _ in other.vectors[1:]}
    timed = one.timed and other.timed and not shared
    return timed and np.array_equal(one.vectors[0][1], other.vectors[0][1])


def _at_one_rate(groups: Sequence[Group]) -> tuple[Sequence[Group], str]:
    """Hold the columns of every group on the instants of the quickest, where they are of one measurement."""
    names = [name for group in groups for name, _, _ in group.vectors[1:]]
    if len(groups) < 2 or not all(group.timed for group in groups) or len(set(names)) < len(names):
        return groups, ""
    quickest = max(groups, key=lambda group: group.rows)
    clocks = {group.name: np.asarray(group.vectors[0][1], dtype=np.float64) for group in groups}
    time = clocks[quickest.name]
    first = max(float(clock[0]) for clock in clocks.values())
    slack = _SAME * float(np.median(np.diff(time)))
    kept = time[time >= first - slack]
    if len(clocks) < len(groups) or len(kept) < _FEWEST or any(np.any(np.diff(each) < 0.0) for each in clocks.values()):
        return groups, ""
    vectors: list[Vector] = [("time_s", kept, "s")]
    for group in groups:
        last = np.searchsorted(clocks[group.name], kept + slack, side="right") - 1
        vectors += [(name, values[last], unit) for name, values, unit in group.vectors[1:]]
    late = 0.5 * max(float(np.median(np.diff(clock))) for clock in clocks.values())
    of = f" of {quickest.name}" if quickest.name else ""
    return [Group("", tuple(vectors))], (
        f"has {len(groups)} groups with times of their own; each column is held from sample to sample on the instants"
        f"{of}: what is measured less often comes late by half its own step, {late:.3g} s at most"
    )


def vectors_of(items: Sequence[tuple[str, NDArray[np.generic], str]]) -> tuple[Vector, ...]:
    """Return the numeric vectors among arrays; n x 1 and 1 x n become (n,), a real matrix stays, to be refused."""
    return tuple(
        (name, array.reshape(-1) if array.size == max(array.shape) else array, unit)
        for name, array, unit in items
        if array.size > 1 and array.dtype.kind in "fiub"
    )

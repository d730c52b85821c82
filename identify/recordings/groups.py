"""Take the one group of vectors that a file of several is read for, or say which there are."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from firmloop.identify.recordings.extent import MOST_BYTES, is_too_large
from firmloop.identify.recordings.table import Misread, RawTable, table_of_arrays

_SAME = 1e-3  # of a step: stamps closer than this differ by rounding
_FEWEST = 3  # instants at which all groups have a value
_AS_QUICK = 0.9  # of the rows of the quickest group: one that may be it
_RARE = 10.0  # steps of the quickest group, beyond which another is written where it changes
_HELD = 0.5  # of the rows: what repeats so often stays from one to the next
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
    clocks = {group.name: np.asarray(group.vectors[0][1], dtype=np.float64) for group in groups}
    most = max(len(clock) for clock in clocks.values())
    likely = [group for group in groups if group.rows > _AS_QUICK * most]
    quickest = min(likely, key=lambda group: _late(clocks[group.name], clocks)) if len(likely) > 1 else likely[0]
    time = clocks[quickest.name]
    first = max(float(clock[0]) for clock in clocks.values())
    slack = _SAME * float(np.median(np.diff(time)))
    kept = time[time >= first - slack]
    if len(clocks) < len(groups) or len(kept) < _FEWEST or any(np.any(np.diff(each) < 0.0) for each in clocks.values()):
        return groups, ""
    kept, rare = _with_rare(kept, clocks, slack)
    vectors: list[Vector] = [("time_s", kept, "s")]
    for group in groups:
        last = np.searchsorted(clocks[group.name], kept + slack, side="right") - 1
        vectors += [
            (
                name,
                _between(clocks[group.name], values, kept, last) if rare and group is quickest else values[last],
                unit,
            )
            for name, values, unit in group.vectors[1:]
        ]
    late = 0.5 * max(float(np.median(np.diff(clock))) for name, clock in clocks.items() if name not in rare)
    of = f" of {quickest.name}" if quickest.name else ""
    also = f", and on those of {', '.join(rare)}" if rare else ""
    return [Group("", tuple(vectors))], (
        f"has {len(groups)} groups with times of their own; each column is held from sample to sample on the instants"
        f"{of}{also}: what is measured less often comes late by half its own step, {late:.3g} s at most"
    )


def _late(time: NDArray[np.float64], clocks: Mapping[str, NDArray[np.float64]]) -> float:
    """Return how old the last samples of all clocks are at these instants, s, on the average of the oldest."""
    ages = (time - clock[np.searchsorted(clock, time, side="right") - 1] for clock in clocks.values())
    return max(float(np.mean(age[age >= 0.0])) if np.any(age >= 0.0) else np.inf for age in ages)


def _with_rare(
    kept: NDArray[np.float64], clocks: Mapping[str, NDArray[np.float64]], slack: float
) -> tuple[NDArray[np.float64], tuple[str, ...]]:
    """Return the instants with those of groups that are written where something changes alone, and their names."""
    step = float(np.median(np.diff(kept)))
    rare = {name: clock for name, clock in clocks.items() if float(np.median(np.diff(clock))) > _RARE * step}
    added = [clock[(clock > kept[0]) & (clock < kept[-1])] for clock in rare.values()]
    new = np.unique(np.concatenate([np.zeros(0), *added]))
    after = np.searchsorted(kept, new)
    new = new[np.minimum(kept[after] - new, new - kept[np.maximum(after - 1, 0)]) > slack]
    if not len(new):
        return kept, ()
    return np.sort(np.concatenate([kept, new])), tuple(rare)


def _between(
    clock: NDArray[np.float64], values: NDArray[np.generic], kept: NDArray[np.float64], last: NDArray[np.intp]
) -> NDArray[np.generic]:
    """Return a column of the quickest group on more instants than its own: what moves in most rows is drawn between."""
    moves = float(np.mean(np.diff(values.astype(np.float64)) == 0.0)) < _HELD
    return np.interp(kept, clock, values.astype(np.float64)) if moves else values[last]


def vectors_of(items: Sequence[tuple[str, NDArray[np.generic], str]]) -> tuple[Vector, ...]:
    """Return the numeric vectors among arrays; n x 1 and 1 x n become (n,), a real matrix stays, to be refused."""
    return tuple(
        (name, array.reshape(-1) if array.size == max(array.shape) else array, unit)
        for name, array, unit in items
        if array.size > 1 and array.dtype.kind in "fiub"
    )

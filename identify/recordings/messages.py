"""Put the messages of topics into columns: each number of a message is one; a topic has a time of its own."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass

import numpy as np

from firmloop.identify.recordings.extent import MOST_BYTES, is_too_large
from firmloop.identify.recordings.groups import Group, table_of_groups
from firmloop.identify.recordings.table import Misread, RawTable

_DEEPEST = 8  # messages in messages
_LONGEST = 64  # numbers of an array; a longer one is a picture or a cloud, no signal
_SECOND = 1_000_000_000  # ns
_REMEDY = "record fewer topics, or export them as CSV"


@dataclass(slots=True)
class _Topic:
    logged: list[int] = field(default_factory=list)  # ns
    stamped: list[int] = field(default_factory=list)  # ns, by its own header; 0 where there is none
    rows: list[dict[str, float]] = field(default_factory=list)


def table_of_messages(messages: Iterable[tuple[str, int, object]]) -> RawTable | Misread:
    """Return the table of (topic, moment of its logging in ns, message); a message is an object or a mapping.

    A topic whose messages carry stamps that rise is timed by those: they say when it was measured.
    """
    topics: dict[str, _Topic] = {}
    size = 0
    for name, moment, message in messages:
        row = dict(_numbers(message, "", 0))
        own = row.pop("header.stamp", 0.0)
        size += 8 * len(row)
        if size > MOST_BYTES:
            return is_too_large(size)
        if row:
            topic = topics.setdefault(name, _Topic())
            topic.logged.append(moment)
            topic.stamped.append(int(own))
            topic.rows.append(row)
    groups = {name: topic for name, topic in topics.items() if len(topic.rows) > 1}
    if not groups:
        return Misread("", "holds no topic with two messages of numbers", "record longer, or other topics")
    clocks = {name: _clock(topic) for name, topic in groups.items()}
    begin = min(clock[0] for clock in clocks.values())
    alone = len(groups) == 1
    return table_of_groups(
        [_group("" if alone else name, topic, clocks[name] - begin) for name, topic in groups.items()], _REMEDY
    )


def _clock(topic: _Topic) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    stamps = np.array(topic.stamped, dtype=np.int64)
    own = bool(np.all(stamps > 0) and np.all(np.diff(stamps) > 0))
    return stamps if own else np.array(topic.logged, dtype=np.int64)


def _group(name: str, topic: _Topic, clock: np.ndarray[tuple[int], np.dtype[np.int64]]) -> Group:
    order = np.argsort(clock, kind="stable")
    names = [each for each in topic.rows[0] if all(each in row for row in topic.rows)]
    vectors = [(_called(name, each), np.array([row[each] for row in topic.rows])[order], "") for each in names]
    return Group(name, (("time_s", clock[order] / _SECOND, "s"), *vectors))


def _called(topic: str, path: str) -> str:
    """Return the name of a column; a message that is one number, `data`, is called like its topic."""
    return path if not topic else topic.strip("/") if path == "data" else f"{topic.strip('/')}.{path}"


def _numbers(value: object, name: str, depth: int) -> Iterator[tuple[str, float]]:
    """Yield every number in a message by its path; a stamp is one number, in ns."""
    if isinstance(value, bool | int | float | np.number | np.bool_):
        yield name or "data", float(value)
    elif isinstance(value, np.ndarray):
        if value.ndim == 1 and value.dtype.kind in "fiub" and len(value) <= _LONGEST:
            yield from ((f"{name}.{k}", float(each)) for k, each in enumerate(value))
    elif isinstance(value, Sequence) and not isinstance(value, str | bytes):
        if len(value) <= _LONGEST and depth < _DEEPEST:
            for k, each in enumerate(value):
                yield from _numbers(each, f"{name}.{k}", depth + 1)
    elif depth < _DEEPEST:
        inside = _inside(value)
        if name == "header.stamp":
            whole, rest = (inside.get(key, 0) for key in ("sec", "nanosec"))
            if isinstance(whole, int) and isinstance(rest, int):  # a float has not enough digits for both
                yield name, whole * _SECOND + rest
            return
        for key, each in inside.items():
            yield from _numbers(each, f"{name}.{key}".strip("."), depth + 1)


def _inside(value: object) -> Mapping[str, object]:
    if isinstance(value, Mapping):
        return {str(key): each for key, each in value.items()}
    if is_dataclass(value):
        return {each.name: getattr(value, each.name) for each in fields(value) if not each.name.startswith("__")}
    return {}

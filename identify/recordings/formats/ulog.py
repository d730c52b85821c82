"""Read ULog files of flight controllers through pyulog, which is installed on request only."""

from __future__ import annotations

import io
from typing import Any

import numpy as np

from firmloop.identify.extras import extra
from firmloop.identify.recordings.formats import Format
from firmloop.identify.recordings.table import Misread, RawTable, table_of_arrays

_MICROSECOND = 1e-6  # s


def read_ulog(content: bytes) -> RawTable | Misread:
    """Put every topic on the instants of the quickest one: each message is held until the next, as they are sent."""
    pyulog = extra("pyulog", "ulog", "a ULog file")
    try:
        topics = [each for each in pyulog.ULog(io.BytesIO(content)).data_list if len(each.data["timestamp"]) > 1]
    except Exception as error:  # a damaged file ends the library in many ways
        reason = str(error).partition("\n")[0][:80] or type(error).__name__
        return Misread("", f"is not a sound ULog file ({reason})", "copy it from the logger again")
    if not topics:
        return Misread("", "holds no topic with two messages", "record longer")
    quickest = max(topics, key=lambda each: len(each.data["timestamp"]))
    clock = np.asarray(quickest.data["timestamp"], dtype=np.int64)
    first = max(int(each.data["timestamp"][0]) for each in topics)
    kept = clock[clock >= first]
    if len(kept) < 2:
        return Misread("", "holds topics that were not logged at the same time", "log them together, or export as CSV")
    columns: list[tuple[str, Any]] = [("time_s", (kept - kept[0]) * _MICROSECOND)]
    for topic in topics:
        last = np.searchsorted(np.asarray(topic.data["timestamp"], dtype=np.int64), kept, side="right") - 1
        name = topic.name if not topic.multi_id else f"{topic.name}_{topic.multi_id}"
        alone = len(topics) == 1
        columns += [
            (field if alone else f"{name}.{field}", np.asarray(values)[last])
            for field, values in topic.data.items()
            if field != "timestamp" and np.asarray(values).dtype.kind in "fiub"
        ]
    table = table_of_arrays(tuple(columns))
    if isinstance(table, Misread) or len(topics) == 1:
        return table
    held = f"has {len(topics)} topics; each is held from message to message, on the instants of {quickest.name}"
    return RawTable(table.names, table.columns, table.place, table.places, (), (held,))


FORMAT = Format((".ulg",), read_ulog)

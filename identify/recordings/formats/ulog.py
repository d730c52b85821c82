"""Read ULog files of flight controllers through pyulog, which is installed on request only."""

from __future__ import annotations

import io
from typing import Any

import numpy as np

from firmloop.identify.extras import extra
from firmloop.identify.recordings.formats import Format
from firmloop.identify.recordings.groups import Group, table_of_groups, vectors_of
from firmloop.identify.recordings.table import Misread, RawTable

_MICROSECOND = 1e-6  # s
_REMEDY = "log fewer topics, or export as CSV"


def read_ulog(content: bytes) -> RawTable | Misread:
    """Take the numbers of every topic that has two messages."""
    pyulog = extra("pyulog", "ulog", "a ULog file")
    try:
        topics = [each for each in pyulog.ULog(io.BytesIO(content)).data_list if len(each.data["timestamp"]) > 1]
    except Exception as error:  # a damaged file ends the library in many ways
        reason = str(error).partition("\n")[0][:80] or type(error).__name__
        return Misread("", f"is not a sound ULog file ({reason})", "copy it from the logger again")
    if not topics:
        return Misread("", "holds no topic with two messages", "record longer")
    begin = min(int(each.data["timestamp"][0]) for each in topics)
    return table_of_groups([_group(each, begin, len(topics) == 1) for each in topics], _REMEDY)


def _group(topic: Any, begin: int, alone: bool) -> Group:
    name = topic.name if not topic.multi_id else f"{topic.name}_{topic.multi_id}"
    time = (np.asarray(topic.data["timestamp"], dtype=np.int64) - begin) * _MICROSECOND
    values = [
        (field if alone else f"{name}.{field}", np.asarray(each), "")
        for field, each in topic.data.items()
        if field != "timestamp"
    ]
    return Group("" if alone else name, (("time_s", time, "s"), *vectors_of(values)))


FORMAT = Format((".ulg",), read_ulog)

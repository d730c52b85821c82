"""Read MCAP files: messages in JSON through mcap, those of ROS through rosbags; both are installed on request only."""

from __future__ import annotations

import io
import json
from collections.abc import Iterator
from typing import Any

from firmloop.identify.extras import extra
from firmloop.identify.recordings.formats import Format
from firmloop.identify.recordings.formats.rosbag import read_ros
from firmloop.identify.recordings.messages import table_of_messages
from firmloop.identify.recordings.table import Misread, RawTable

_OF_ROS = ("cdr", "ros1")


def read_mcap(content: bytes) -> RawTable | Misread:
    """Take the numbers of all topics."""
    extra("mcap", "mcap", "an MCAP file")
    reader = extra("mcap.reader", "mcap", "an MCAP file")
    try:
        channels = [each for _, each, _ in reader.make_reader(io.BytesIO(content)).iter_messages()]
        written = {str(each.message_encoding) for each in channels}
        if "json" in written:
            return table_of_messages(_of_json(reader.make_reader(io.BytesIO(content))))
    except Exception as error:  # a damaged file ends the library in many ways
        reason = str(error).partition("\n")[0][:80] or type(error).__name__
        return Misread("", f"is not a sound MCAP file ({reason})", "record it again, or export it as CSV")
    if written & set(_OF_ROS):
        return read_ros(content, ".mcap")
    held = ", ".join(sorted(written)) or "none"
    return Misread("", f"holds messages in {held}; read are json and cdr", "export it as CSV, or write it in JSON")


def _of_json(reader: Any) -> Iterator[tuple[str, int, object]]:
    for _, channel, message in reader.iter_messages():
        if channel.message_encoding == "json":
            yield str(channel.topic), int(message.log_time), json.loads(message.data)


FORMAT = Format((".mcap",), read_mcap)

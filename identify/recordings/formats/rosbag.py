"""Read the bags of ROS 1 and ROS 2 through rosbags, which is installed on request only."""

from __future__ import annotations

import tempfile
from pathlib import Path

from firmloop.identify.extras import extra
from firmloop.identify.recordings.formats import Format
from firmloop.identify.recordings.messages import table_of_messages
from firmloop.identify.recordings.table import Misread, RawTable


def read_bag(content: bytes) -> RawTable | Misread:
    """Take the numbers of all topics; what kind of bag it is, its first bytes say."""
    ending = ".bag" if content.startswith(b"#ROSBAG") else ".db3" if content.startswith(b"SQLite") else ".mcap"
    return read_ros(content, ending)


def read_ros(content: bytes, ending: str) -> RawTable | Misread:
    """Read a bag of the kind that `ending` says; the library reads files only."""
    extra("rosbags", "rosbag", "a bag of ROS")
    highlevel = extra("rosbags.highlevel", "rosbag", "a bag of ROS")
    typesys = extra("rosbags.typesys", "rosbag", "a bag of ROS")
    with tempfile.TemporaryDirectory(prefix="firmloop_bag_") as folder:
        path = Path(folder) / f"run{ending}"
        path.write_bytes(content)
        try:
            usual = typesys.get_typestore(typesys.Stores.LATEST)
            with highlevel.AnyReader([path], default_typestore=usual) as bag:
                return table_of_messages(
                    (link.topic, int(moment), bag.deserialize(raw, link.msgtype))
                    for link, moment, raw in bag.messages()
                )
        except Exception as error:  # a damaged file ends the library in many ways
            reason = str(error).replace(folder, "").partition("\n")[0][:80] or type(error).__name__
            return Misread("", f"is not a sound bag of ROS ({reason})", "record it again, or export it as CSV")


FORMAT = Format((".bag", ".db3"), read_bag)

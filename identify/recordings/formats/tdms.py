"""Read TDMS files of LabVIEW through npTDMS, which is installed on request only."""

from __future__ import annotations

import io
from typing import Any

import numpy as np

from firmloop.identify.extras import extra
from firmloop.identify.recordings.extent import MOST_BYTES, is_too_large
from firmloop.identify.recordings.formats import Format
from firmloop.identify.recordings.groups import Group, Vector, table_of_groups, vectors_of
from firmloop.identify.recordings.table import Misread, RawTable

_REMEDY = "write one group with one rate, or export it as CSV"


def read_tdms(content: bytes) -> RawTable | Misread:
    """Take the channels of the only group; a waveform's increment stands for its time."""
    nptdms = extra("nptdms", "tdms", "a TDMS file")
    try:
        with nptdms.TdmsFile.read(io.BytesIO(content)) as file:
            size = 8 * sum(len(channel) for group in file.groups() for channel in group.channels())
            if size > MOST_BYTES:
                return is_too_large(size)
            groups = [_group(group) for group in file.groups()]
    except Exception as error:  # a damaged file ends the library in many ways
        reason = str(error).partition("\n")[0][:80] or type(error).__name__
        return Misread("", f"is not a sound TDMS file ({reason})", "write it again, or export it as CSV")
    return table_of_groups([each for each in groups if each.vectors], _REMEDY)


def _group(group: Any) -> Group:
    channels = list(group.channels())
    made = vectors_of([(each.name, np.asarray(each[:]), _unit(each)) for each in channels])
    increments = [each.properties.get("wf_increment") for each in channels if len(each) > 1]
    if not made or not increments or not isinstance(increments[0], float) or set(increments) != {increments[0]}:
        return Group(str(group.name), made)
    start = float(channels[0].properties.get("wf_start_offset", 0.0))
    time: Vector = ("time_s", start + increments[0] * np.arange(len(made[0][1])), "s")
    return Group(str(group.name), (time, *(each for each in made if each[0] != "time_s")))


def _unit(channel: Any) -> str:
    return str(channel.properties.get("unit_string", channel.properties.get("NI_UnitDescription", "")))


FORMAT = Format((".tdms",), read_tdms)

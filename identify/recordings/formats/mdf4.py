"""Read MDF files of measurement and calibration tools through asammdf, which is installed on request only."""

from __future__ import annotations

import gc
import io
import sys
from typing import Any

import numpy as np

from firmloop.identify.extras import extra
from firmloop.identify.recordings.extent import MOST_BYTES, is_too_large
from firmloop.identify.recordings.formats import Format
from firmloop.identify.recordings.groups import Group, table_of_groups, vectors_of
from firmloop.identify.recordings.table import Misread, RawTable

_REMEDY = "bring it to one rate first: asammdf.MDF('r.mf4').resample(raster=0.001).save('one_rate.mf4')"


def read_mdf(content: bytes) -> RawTable | Misread:
    """Take the channels of all groups that share one time."""
    asammdf = extra("asammdf", "mdf4", "an MDF file")
    told = sys.unraisablehook
    sys.unraisablehook = lambda _: None  # of a damaged file the library's destructor prints a traceback of its own
    try:
        return _read(asammdf, content)
    finally:
        gc.collect()  # else the destructor runs later
        sys.unraisablehook = told


def _read(asammdf: Any, content: bytes) -> RawTable | Misread:
    try:
        with asammdf.MDF(io.BytesIO(content)) as file:
            size = sum(8 * each.channel_group.cycles_nr * len(each.channels) for each in file.groups)
            if size > MOST_BYTES:
                return is_too_large(size)
            groups = [_group(file, number) for number in range(len(file.groups))]
    except Exception as error:  # a damaged file ends the library in many ways
        reason = str(error).partition("\n")[0][:80] or type(error).__name__
        return Misread("", f"is not a sound MDF file ({reason})", "write it again, or export it as CSV")
    return table_of_groups([each for each in groups if each.vectors], _REMEDY)


def _group(file: Any, number: int) -> Group:
    master = file.masters_db.get(number)
    signals = [
        file.get(group=number, index=index) for index in range(len(file.groups[number].channels)) if index != master
    ]
    vectors = vectors_of([(each.name, np.asarray(each.samples), each.unit or "") for each in signals])
    if not vectors or master is None:
        return Group(f"{number}", vectors)
    time = np.asarray(signals[0].timestamps, dtype=np.float64)
    return Group("" if len(file.groups) == 1 else f"{number}", (("time_s", time, "s"), *vectors))


FORMAT = Format((".mf4", ".mdf"), read_mdf)

"""Read HDF5 files that hold one vector per column, at their top or in one group."""

from __future__ import annotations

from firmloop.identify.recordings.formats import Format
from firmloop.identify.recordings.groups import table_of_groups
from firmloop.identify.recordings.hdf5_groups import hdf5_groups
from firmloop.identify.recordings.table import Misread, RawTable

_REMEDY = "save one group with a vector for time_s and for each signal"


def read_hdf5(content: bytes) -> RawTable | Misread:
    """Take the vectors of the top, else those of the only group that has some."""
    try:
        groups = hdf5_groups(content, "an HDF5 file")
    except (OSError, EOFError, ValueError, TypeError, KeyError, IndexError, RuntimeError, MemoryError) as error:
        reason = str(error).partition("\n")[0][:80]
        return Misread("", f"is not a sound HDF5 file ({reason})", "write it again")
    return groups if isinstance(groups, Misread) else table_of_groups(groups, _REMEDY)


FORMAT = Format((".h5", ".hdf5", ".hdf"), read_hdf5)

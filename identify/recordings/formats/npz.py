"""Read NumPy archives that hold one 1-D array per column."""

from __future__ import annotations

import io
import zipfile
import zlib

import numpy as np

from firmloop.identify.recordings.extent import npz_extent
from firmloop.identify.recordings.formats import Format
from firmloop.identify.recordings.table import Misread, RawTable, table_of_arrays

_DAMAGED = (
    *(OSError, EOFError, RuntimeError, NotImplementedError, ValueError, AttributeError, TypeError),
    *(zipfile.BadZipFile, zlib.error),
)


def read_npz(content: bytes) -> RawTable | Misread:
    """Load every array, never running pickled code."""
    try:
        if wrong := npz_extent(content):
            return wrong
        with np.load(io.BytesIO(content), allow_pickle=False) as archive:
            arrays = tuple((name, np.asarray(archive[name])) for name in archive.files)
    except _DAMAGED as error:
        reason = str(error).partition("\n")[0][:80]
        return Misread("", f"is not an .npz archive of plain numbers ({reason})", "write it with numpy.savez")
    return table_of_arrays(arrays)


FORMAT = Format((".npz",), read_npz)

"""Read MATLAB files, level 5 and 7.3 (HDF5), that hold one vector per column."""

from __future__ import annotations

import io
import zlib
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from firmloop.identify.extras import extra
from firmloop.identify.recordings.extent import MOST_BYTES, is_too_large, unpacked_mat
from firmloop.identify.recordings.formats import Format
from firmloop.identify.recordings.mat_level5 import mat_arrays
from firmloop.identify.recordings.table import Misread, RawTable, table_of_arrays

_HDF5 = b"\x89HDF\r\n\x1a\n"


def read_mat(content: bytes) -> RawTable | Misread:
    """Take every numeric vector of the file; text, scalars and structures are left aside."""
    try:
        if _HDF5 in content[:1024]:
            h5py = extra("h5py", "hdf5", "a MATLAB 7.3 file")
            with h5py.File(io.BytesIO(content), "r") as file:
                items = [(str(name), item) for name, item in file.items() if hasattr(item, "dtype")]
                size = sum(item.size * item.dtype.itemsize for _, item in items)
                if size > MOST_BYTES:
                    return is_too_large(size)
                found = [(name, np.asarray(item[()])) for name, item in items]
        else:
            plain = unpacked_mat(content)
            if isinstance(plain, Misread):
                return plain
            found = [(name, value) for name, value in mat_arrays(plain) if not name.startswith("__")]
    except (OSError, EOFError, ValueError, TypeError, KeyError, IndexError, zlib.error) as error:
        reason = str(error).partition("\n")[0][:80]
        return Misread("", f"is not a MATLAB file of level 5 or 7.3 ({reason})", "write it with save(..., '-v7')")
    except (RuntimeError, MemoryError) as error:
        return Misread("", f"is a damaged MATLAB file ({error})", "write it again with save(..., '-v7')")
    arrays = tuple(_vectors(found))
    if not arrays:
        return Misread("", "holds no numeric vector", "save time_s and each signal as a vector of its own")
    return table_of_arrays(arrays)


def _vectors(found: Iterable[tuple[str, NDArray[np.generic]]]) -> Iterable[tuple[str, NDArray[np.generic]]]:
    """MATLAB has no 1-D arrays: n x 1 and 1 x n become (n,); a real matrix stays as it is and is refused later."""
    for name, array in found:
        if array.size > 1 and array.dtype.kind in "fiub":
            yield name, array.reshape(-1) if array.size == max(array.shape) else array


FORMAT = Format((".mat",), read_mat)

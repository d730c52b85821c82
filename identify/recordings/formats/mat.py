"""Read MATLAB files, level 5 and 7.3 (HDF5), that hold one vector per column or one structure of vectors."""

from __future__ import annotations

import zlib
from collections.abc import Iterator, Mapping

import numpy as np

from firmloop.identify.recordings.extent import unpacked_mat
from firmloop.identify.recordings.formats import Format
from firmloop.identify.recordings.groups import Group, table_of_groups, vectors_of
from firmloop.identify.recordings.hdf5_groups import hdf5_groups
from firmloop.identify.recordings.mat_level5 import mat_variables
from firmloop.identify.recordings.table import Misread, RawTable

_HDF5 = b"\x89HDF\r\n\x1a\n"
_DEEPEST = 8  # structures in structures
_REMEDY = "save time_s and each signal as a vector of its own"
_TABLE = (
    "save its columns as a structure: s = table2struct(timetable2table(T), 'ToScalar', true); "
    "s.time_s = seconds(T.Properties.RowTimes); save('r.mat', '-struct', 's')"
)


def read_mat(content: bytes) -> RawTable | Misread:
    """Take every numeric vector of the file, else those of its only structure; text and scalars are left aside."""
    try:
        if _HDF5 in content[:1024]:
            groups = hdf5_groups(content, "a MATLAB 7.3 file")
            opaque = b"MATLAB_object_decode" in content
        else:
            plain = unpacked_mat(content)
            if isinstance(plain, Misread):
                return plain
            found = mat_variables(plain)
            groups = tuple(_groups({name: each for name, each in found.values.items() if name[:2] != "__"}, "", 0))
            groups = groups[:1] if groups and not groups[0].name else groups
            opaque = found.objects
    except (OSError, EOFError, ValueError, TypeError, KeyError, IndexError, zlib.error) as error:
        reason = str(error).partition("\n")[0][:80]
        return Misread("", f"is not a MATLAB file of level 5 or 7.3 ({reason})", "write it with save(..., '-v7')")
    except (RuntimeError, MemoryError) as error:
        return Misread("", f"is a damaged MATLAB file ({error})", "write it again with save(..., '-v7')")
    if isinstance(groups, Misread):
        return groups
    if not groups and opaque:
        return Misread("", "holds a table, a timetable or another object, which only MATLAB can open", _TABLE)
    if not groups:
        return Misread("", "holds no numeric vector", _REMEDY)
    return table_of_groups(groups, _REMEDY)


def _groups(variables: Mapping[str, object], place: str, depth: int) -> Iterator[Group]:
    """Yield the vectors of a structure, then those of the structures in it."""
    arrays = [(name, value, "") for name, value in variables.items() if isinstance(value, np.ndarray)]
    own = vectors_of(arrays)
    if own:
        yield Group(place, own)
    if depth < _DEEPEST:
        for name, value in variables.items():
            if isinstance(value, dict):
                yield from _groups(value, f"{place}.{name}".strip("."), depth + 1)


FORMAT = Format((".mat",), read_mat)

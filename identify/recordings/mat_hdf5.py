"""Take the numeric arrays and structures of a MATLAB file of version 7.3 apart, which is HDF5.

An array is stored with its sizes in reverse, an array of structures as one array of references a field, and text as
numbers; `MATLAB_class` says which is which. What refers to an object is one that only MATLAB can open.
"""

from __future__ import annotations

import io
from collections.abc import Mapping
from typing import Any

import numpy as np

from firmloop.identify.extras import extra
from firmloop.identify.recordings.extent import MOST_BYTES, too_large
from firmloop.identify.recordings.hdf5_groups import entries
from firmloop.identify.recordings.mat_level5 import COMPLEX, DEEPEST, MOST_STRUCTURES, OBJECT, MatVariables

_TEXT, _CELL, _MOST_TEXT = b"char", b"cell", 1000
_MOST_VALUES = 100_000  # of a file, each as often as it is referred to: structures may refer to themselves


def mat73_variables(content: bytes) -> MatVariables:
    """Give every numeric variable and every structure of them, arrays with their sizes as they are stored.

    Raises
    ------
    OSError, ValueError, KeyError, RuntimeError
        when the file is damaged, or holds too much.
    ToolError
        when h5py is not there.
    """
    h5py = extra("h5py", "hdf5", "a MATLAB 7.3 file")
    with h5py.File(io.BytesIO(content), "r") as file:
        return MatVariables.among(_Reader(file).structure(file["/"], DEEPEST + 1))


class _Reader:
    """Reads one file, and counts what it has read: many references may lead to one large array, or in a circle."""

    def __init__(self, file: Any) -> None:
        self.file, self.read, self.values = file, 0, 0

    def structure(self, group: Any, depth: int) -> Mapping[str, object]:
        found = ((name, self.value(item, depth - 1)) for name, item in entries(group))
        return {name: value for name, value in found if value is not None}

    def value(self, item: Any, depth: int) -> object:
        self.values += 1
        if self.values > _MOST_VALUES:
            raise ValueError(f"its structures refer to more than {_MOST_VALUES:,} values")
        if hasattr(item, "items"):
            return self._structures(item, depth) if depth > 0 else None
        said = item.attrs.get("MATLAB_class")
        if "MATLAB_object_decode" in item.attrs:
            return OBJECT
        if said == _TEXT:
            return self._text(item)
        if item.dtype.names == ("real", "imag"):
            return COMPLEX
        return self._array(item) if item.dtype.kind in "fiub" else None

    def _structures(self, group: Any, depth: int) -> object:
        """Return one structure, or each of an array of them: there every field is references, one a structure."""
        fields = entries(group)
        counts = {item.size if _refers(item) else 0 for _, item in fields}
        count = counts.pop() if len(counts) == 1 else 0
        if not 0 < count <= MOST_STRUCTURES:
            return self.structure(group, depth)
        rows = [(name, np.asarray(item[()]).reshape(-1)) for name, item in fields]
        inner = ({name: self.value(self.file[row[k]], depth - 1) for name, row in rows} for k in range(count))
        return tuple({name: value for name, value in each.items() if value is not None} for each in inner)

    def _array(self, item: Any) -> object:
        self.read += item.size * item.dtype.itemsize
        if self.read > MOST_BYTES:
            raise ValueError(too_large(self.read))
        return np.asarray(item[()])

    def _text(self, item: Any) -> str:
        if item.attrs.get("MATLAB_empty") or item.size > _MOST_TEXT:
            return ""
        return "".join(map(chr, np.asarray(item[()]).T.reshape(-1).tolist()))


def _refers(item: Any) -> bool:
    """Tell the field of an array of structures from a cell array, which is references, too."""
    is_references = hasattr(item, "dtype") and item.dtype.kind == "O" and item.dtype.metadata is not None
    return is_references and item.attrs.get("MATLAB_class") != _CELL

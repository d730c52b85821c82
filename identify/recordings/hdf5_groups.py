"""Read the groups of an HDF5 file, as instruments, Python and MATLAB 7.3 write them."""

from __future__ import annotations

import io
from collections.abc import Iterator
from typing import Any

import numpy as np

from firmloop.identify.extras import extra
from firmloop.identify.recordings.extent import MOST_BYTES, MOST_COLUMNS, is_too_large
from firmloop.identify.recordings.groups import Group, vectors_of
from firmloop.identify.recordings.table import Misread

_DEEPEST = 1000  # letters of a place among groups in groups
_UNITS = ("units", "unit", "Units", "Unit")
_TEXT = b"char"  # MATLAB stores text as numbers, and says so


def hdf5_groups(content: bytes, needed_for: str) -> tuple[Group, ...] | Misread:
    """Return every group with its vectors; of one whose top holds vectors, only those.

    Raises
    ------
    OSError, ValueError, KeyError, RuntimeError
        when the file is damaged.
    """
    h5py = extra("h5py", "hdf5", needed_for)
    with h5py.File(io.BytesIO(content), "r") as file:
        found = list(_groups(file["/"], "", {file["/"].id}))
        size = sum(item.size * item.dtype.itemsize for _, items in found for _, item in items)
        if size > MOST_BYTES:
            return is_too_large(size)
        groups = tuple(
            Group(place, vectors_of([(name, np.asarray(item[()]), _unit(item)) for name, item in items]))
            for place, items in found
        )
    held = tuple(group for group in groups if group.vectors)
    return held[:1] if held and not held[0].name else held


def _groups(group: Any, place: str, seen: set[Any]) -> Iterator[tuple[str, list[tuple[str, Any]]]]:
    """Yield the vectors of a group and of those in it, each once: links may lead in circles, and many ways to one."""
    items = entries(group)
    own = [(name, item) for name, item in items if hasattr(item, "dtype") and _is_number(item)]
    if own:
        yield place, own
    for name, item in items:
        if hasattr(item, "items") and item.id not in seen and len(place) < _DEEPEST:
            seen.add(item.id)
            yield from _groups(item, f"{place}/{name}".strip("/"), seen)


def entries(group: Any) -> list[tuple[str, Any]]:
    """Return what a group holds by name, without what MATLAB keeps for itself.

    Raises
    ------
    ValueError
        when it is too much, or something of it is not in this file.
    """
    if len(group) > MOST_COLUMNS:
        raise ValueError(f"a group of it holds {len(group):,} entries; at most {MOST_COLUMNS:,} are read")
    elsewhere = [str(name) for name in group if hasattr(group.get(name, getlink=True), "filename")]
    items = (
        [(str(name), item) for name, item in group.items() if not str(name).startswith("#")] if not elsewhere else []
    )
    elsewhere += [name for name, item in items if item is None or _reaches_out(item)]
    if elsewhere:
        raise ValueError(f"{elsewhere[0]} of it stands in another file, or nowhere")
    return items


def _reaches_out(item: Any) -> bool:
    """Tell whether numbers are not in this file: a recording reads no other file of the machine."""
    return bool(getattr(item, "external", None)) or bool(getattr(item, "is_virtual", False))


def _is_number(item: Any) -> bool:
    """Tell numbers from text, and from the references that stand for a MATLAB object."""
    is_object = "MATLAB_object_decode" in item.attrs
    return bool(item.dtype.kind in "fiub") and item.attrs.get("MATLAB_class") != _TEXT and not is_object


def _unit(item: Any) -> str:
    said = next((item.attrs[name] for name in _UNITS if name in item.attrs), "")
    return said.decode("utf-8", "replace") if isinstance(said, bytes) else str(said) if isinstance(said, str) else ""

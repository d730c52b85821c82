"""Take the numeric arrays of a MATLAB file of level 5 apart, never reading past what is there.

scipy reads these files too, but damage of a few bytes ends the whole process in its compiled part. The layout is that
of MathWorks' "MAT-File Level 5 File Format".
"""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

HEADER = 128
_MATRIX, _TAG, _WORD = 14, 8, 4
_ORDERS = {b"IM": "<", b"MI": ">"}
_STORED = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
_CLASSES = {6: "f8", 7: "f4", 8: "i1", 9: "u1", 10: "i2", 11: "u2", 12: "i4", 13: "u4", 14: "i8", 15: "u8"}
_COMPLEX = 0x0800


@dataclass(frozen=True, slots=True)
class _Element:
    kind: int
    body: bytes
    end: int  # where the next one begins, without what fills up to 8 bytes


def mat_arrays(content: bytes) -> Iterator[tuple[str, NDArray[np.generic]]]:
    """Give name and array of every real numeric variable; `content` is unpacked.

    Raises
    ------
    ValueError
        when it is no such file, or a size in it contradicts another.
    """
    order = _ORDERS.get(content[HEADER - 2 : HEADER])
    if order is None:
        raise ValueError("its header does not say how bytes are ordered")
    at = HEADER
    while at < len(content):
        element = _element(content, at, order)
        if element.kind == _MATRIX:
            found = _array(element.body, order)
            if found is not None:
                yield found
        at = element.end


def _element(content: bytes, at: int, order: str) -> _Element:
    """Read one data element; one of at most 4 bytes may stand within its tag."""
    if at + _TAG > len(content):
        raise ValueError("it ends within a data element")
    kind, size = struct.unpack_from(order + "II", content, at)
    begin = at + _TAG
    if kind >> 16:
        kind, size, begin = kind & 0xFFFF, kind >> 16, at + _WORD
        if size > _WORD:
            raise ValueError(f"a small data element claims {size} bytes")
    if begin + size > len(content):
        raise ValueError(f"a data element claims {size:,} bytes, {len(content) - begin:,} are there")
    return _Element(kind, content[begin : begin + size], max(at + _TAG, begin + size))


def _array(body: bytes, order: str) -> tuple[str, NDArray[np.generic]] | None:
    """Read one variable; None for text, structures, cells, sparse and complex arrays."""
    parts, at = [], 0
    for _ in range(4):  # flags, sizes, name, values
        if at >= len(body):
            break
        parts.append(_element(body, at, order))
        at = parts[-1].end + -parts[-1].end % _TAG
        if len(parts) == 1:
            flags = int.from_bytes(parts[0].body[:_WORD], "little" if order == "<" else "big")
            if flags & 0xFF not in _CLASSES or flags & _COMPLEX:
                return None
    if len(parts) < 4:
        raise ValueError("a variable has no values")
    sizes = np.frombuffer(parts[1].body, order + "i4").tolist()
    stored = _STORED.get(parts[3].kind)
    if stored is None or min(sizes, default=0) < 0:
        raise ValueError("a variable has values or sizes of no known kind")
    values = np.frombuffer(parts[3].body, order + stored)
    if values.size != math.prod(sizes):
        raise ValueError(f"a variable of {math.prod(sizes):,} values holds {values.size:,}")
    name = parts[2].body.decode("utf-8", "replace")
    return name, values.astype(_CLASSES[flags & 0xFF]).reshape(sizes, order="F")

"""Take the numeric arrays and structures of a MATLAB file of level 5 apart, never reading past what is there.

scipy reads these files too, but damage of a few bytes ends the whole process in its compiled part. The layout is that
of MathWorks' "MAT-File Level 5 File Format".
"""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

HEADER = 128
_MATRIX, _TAG, _WORD = 14, 8, 4
_ORDERS = {b"IM": "<", b"MI": ">"}
_STORED = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
_CLASSES = {6: "f8", 7: "f4", 8: "i1", 9: "u1", 10: "i2", 11: "u2", 12: "i4", 13: "u4", 14: "i8", 15: "u8"}
_COMPLEX = 0x0800
_STRUCTURE, _TEXT = 2, 4  # classes of variables
_OBJECTS = (3, 17)  # tables, timetables, timeseries, strings
DEEPEST = 8  # structures in structures
MOST_STRUCTURES = 2000  # in one array of them
_TEXTS = {2: "latin-1", 4: "utf-16", 16: "utf-8", 17: "utf-16", 18: "utf-32"}  # how letters are stored


@dataclass(frozen=True, slots=True)
class _Element:
    kind: int
    body: bytes
    end: int  # where the next one begins, without what fills up to 8 bytes


@dataclass(frozen=True, slots=True)
class Unread:
    """A variable that is not read, in words."""

    says: str


OBJECT, COMPLEX = Unread("an object that only MATLAB can open"), Unread("complex numbers")


@dataclass(frozen=True, slots=True)
class MatVariables:
    """What a file holds by name: arrays, structures as mappings of the same, arrays of these as tuples, and objects.

    Structures hold their texts and what is complex, too; of the file's own variables the latter are named.
    """

    values: Mapping[str, object]
    complex_names: tuple[str, ...] = ()

    @classmethod
    def among(cls, found: Mapping[str, object]) -> MatVariables:
        """Leave texts aside, and name what is complex."""
        values = {name: each for name, each in found.items() if each is not COMPLEX and not isinstance(each, str)}
        return cls(values, tuple(name for name, each in found.items() if each is COMPLEX))


def mat_variables(content: bytes) -> MatVariables:
    """Give every real numeric variable and every structure of them; `content` is unpacked.

    Raises
    ------
    ValueError
        when it is no such file, or a size in it contradicts another.
    """
    order = _ORDERS.get(content[HEADER - 2 : HEADER])
    if order is None:
        raise ValueError("its header does not say how bytes are ordered")
    values: dict[str, object] = {}
    at = HEADER
    while at < len(content):
        element = _element(content, at, order)
        if element.kind == _MATRIX:
            found = _variable(element.body, order, DEEPEST)
            if found is not None:
                values[found[0]] = found[1]
        at = element.end
    return MatVariables.among(values)


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


def _variable(body: bytes, order: str, depth: int) -> tuple[str, object] | None:
    """Read one variable; None for cells and sparse arrays."""
    if not body:
        return None  # an empty field
    kind, flags = _flags(body, order)
    if kind == _STRUCTURE:
        return _structure(body, order, depth)
    if kind in _OBJECTS:
        return _name(_parts(body, order, 2)[1]), OBJECT  # an opaque one has no sizes
    if kind == _TEXT:
        return _text(_parts(body, order, 4))
    if kind not in _CLASSES:
        return None
    if flags & _COMPLEX:
        return _name(_parts(body, order, 3)[2]), COMPLEX
    parts = _parts(body, order, 4)  # flags, sizes, name, values
    if len(parts) < 4:
        raise ValueError("a variable has no values")
    sizes = _sizes(parts[1], order)
    stored = _STORED.get(parts[3].kind)
    if stored is None or min(sizes, default=0) < 0:
        raise ValueError("a variable has values or sizes of no known kind")
    values = np.frombuffer(parts[3].body, order + stored)
    if values.size != math.prod(sizes):
        raise ValueError(f"a variable of {math.prod(sizes):,} values holds {values.size:,}")
    return _name(parts[2]), values.astype(_CLASSES[kind]).reshape(sizes, order="F")


def _structure(body: bytes, order: str, depth: int) -> tuple[str, object] | None:
    """Read one structure: flags, sizes, name, the length of field names, the names, then a variable a field."""
    parts = _parts(body, order, None)
    if len(parts) < 5 or len(parts[3].body) != _WORD:
        raise ValueError("a structure has no fields")
    if depth == 0:
        return None
    count = math.prod(_sizes(parts[1], order))
    length = max(int(np.frombuffer(parts[3].body, order + "i4")[0]), 1)
    names = [parts[4].body[k : k + length].partition(b"\0")[0] for k in range(0, len(parts[4].body), length)]
    if len(names) * count != len(parts) - 5 or not 0 <= count <= MOST_STRUCTURES:
        raise ValueError(f"{count:,} structures of {len(names)} fields hold {len(parts) - 5}")
    found: list[dict[str, object]] = [{} for _ in range(count)]
    for k, part in enumerate(parts[5:]):
        field = _variable(part.body, order, depth - 1) if part.kind == _MATRIX else None
        if field is not None:
            found[k // len(names)][names[k % len(names)].decode("utf-8", "replace")] = field[1]
    return _name(parts[2]), found[0] if count == 1 else tuple(found)


def _text(parts: list[_Element]) -> tuple[str, object] | None:
    """Read text: flags, sizes, name, letters."""
    if len(parts) < 4 or parts[3].kind not in _TEXTS:
        return None
    return _name(parts[2]), parts[3].body.decode(_TEXTS[parts[3].kind], "replace")


def _flags(body: bytes, order: str) -> tuple[int, int]:
    """Return the class of a variable, and its flags."""
    word = int.from_bytes(_element(body, 0, order).body[:_WORD], "little" if order == "<" else "big")
    return word & 0xFF, word


def _parts(body: bytes, order: str, most: int | None) -> list[_Element]:
    """Read the data elements that a variable is made of, the first `most` of them."""
    parts: list[_Element] = []
    at = 0
    while at < len(body) and (most is None or len(parts) < most):
        parts.append(_element(body, at, order))
        at = parts[-1].end + -parts[-1].end % _TAG
    return parts


def _sizes(part: _Element, order: str) -> list[int]:
    return [int(each) for each in np.frombuffer(part.body, order + "i4")]


def _name(part: _Element) -> str:
    return part.body.decode("utf-8", "replace")

"""Give the compiled code the programs that a controller solves in each sample, as it reads them."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from firmloop.design.outcome import COLUMN
from firmloop.quantize.twins.qp import Rows
from firmloop.quantize.twins.rti_course import RtiCourse

WIDTH = 128  # lanes of a row, as in lanes.c


def _structure(name: str, sizes: tuple[str, ...], arrays: tuple[str, ...], limits: tuple[str, ...], last: int) -> Any:
    """Return the type of a structure of these integers, arrays and numbers, and of `last` more addresses."""
    fields = [
        *((size, ctypes.c_int64) for size in sizes),
        *((array, ctypes.c_void_p) for array in arrays),
        *((limit, ctypes.c_double) for limit in limits),
        *((f"address_{k}", ctypes.c_void_p) for k in range(last)),
    ]
    return type(name, (ctypes.Structure,), {"_fields_": fields})


class CompiledModel(Protocol):
    """A program without state in compiled code."""

    @property
    def places(self) -> tuple[int, int]:
        """Where its plan stands in memory, and its rows."""


_ARRAYS = ("q", "r", "p", "change", "rest", "low", "high", "weight")
_LIMITS = ("tolerance", "trusted", "least")
_Course = _structure(
    "_Course",
    ("n", "m", "length", "c", "iterations", "budget", "parameter_count", "target"),
    ("limited", *_ARRAYS),
    _LIMITS,
    4,
)
_ROWS = ("low", "high", "gram", "scale", "shift", "onward", "softness")
_TELLING = ("tolerance", "share", "trusted", "kept", "noise", "least")
_Problem = _structure(
    "_Problem",
    ("count", "room", "budget", "moves", "many", "column", "told", "parameter_count", "target"),
    ("slope", *_ROWS),
    _TELLING,
    3,
)


@dataclass(frozen=True, slots=True)
class Improving:
    """An operation "improve": its problem, the rows of its parameters, that of its first result, and its model."""

    course: RtiCourse
    places: tuple[int, ...]
    target: int
    model: CompiledModel
    function: ClassVar[str] = "improve"

    @property
    def end(self) -> int:
        """The row of the status, behind outputs, whether there is a plan, the largest change, and the plan."""
        n, m = len(self.course.q), len(self.course.r)
        return self.target + m + 2 + self.course.length * (n + m)

    def read(self, kind: np.dtype[Any], kept: list[object]) -> ctypes.Structure:
        """Return what the compiled code reads; `kept` takes what that points to."""
        own = self.course
        n, m, size, rows = len(own.q), len(own.r), own.unknowns, own.rows
        states = (own.length + 1) * n
        lane = states * (1 + size) + (size + 1) * n + 2 * size * (size + 3) + rows * (2 * size + rows + 8)
        plan = states + size + own.length * n * (1 + n + m) + n + 2 * m + 1
        sizes = (n, m, own.length, len(own.limited), own.iterations, own.budget, len(self.places), self.target)
        limited = _address(np.array(own.limited, np.int64), kept)
        arrays = [_address(np.ascontiguousarray(getattr(own, name), kind), kept) for name in _ARRAYS]
        limits = [getattr(own, name) for name in _LIMITS]
        kept.append(self.model)
        parameters = _address(np.array(self.places, np.int32), kept)
        room = _address(np.zeros(lane + WIDTH * plan, kind), kept)
        found: ctypes.Structure = _Course(*sizes, limited, *arrays, *limits, parameters, *self.model.places, room)
        return found


@dataclass(frozen=True, slots=True)
class Solving:
    """An operation "solve": its problem, the rows of its parameters, and that of its first move."""

    rows: Rows
    places: tuple[int, ...]
    target: int
    function: ClassVar[str] = "solve"

    @property
    def end(self) -> int:
        """The row of the status, behind the moves."""
        return self.target + len(self.rows.scale)

    def read(self, kind: np.dtype[Any], kept: list[object]) -> ctypes.Structure:
        """Return what the compiled code reads; `kept` takes what that points to."""
        own, count, room = self.rows, len(self.rows.low), self.rows.room
        sizes = (count, room, own.budget, own.moves, int(own.many), COLUMN, len(own.scale), len(self.places))
        slope = _address(np.ascontiguousarray(own.slope.T, kind), kept)
        arrays = [_address(np.ascontiguousarray(getattr(own, name), kind), kept) for name in _ROWS]
        limits = [getattr(own, name) for name in _TELLING]
        parameters = _address(np.array(self.places, np.int32), kept)
        basis = (room + 1) * room // 2 if own.many else (room + 1) * count
        memory = _address(np.zeros(3 * count + len(self.places) + 6 * room + basis, kind), kept)
        places = _address(np.zeros(room + count, np.int64), kept)
        found: ctypes.Structure = _Problem(*sizes, self.target, slope, *arrays, *limits, parameters, memory, places)
        return found


def _address(array: NDArray[Any], kept: list[object]) -> int:
    kept.append(array)
    return array.ctypes.data

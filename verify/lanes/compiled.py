"""Run many lanes of operations on rows in compiled code."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from firmloop.identify.simulation.compiler import ToolError, shared_library
from firmloop.verify.lanes.codes import known
from firmloop.verify.lanes.programs import WIDTH, Improving, Solving

Raw = NDArray[Any]
FLAGS = ("-std=c99", "-O2", "-fwrapv", "-ffp-contract=off", "-fno-trapping-math")
FUNCTIONS = {"i8": "i64", "f4": "f32", "f8": "f64", "f16": "long"}  # ends of their names
KINDS = ("i2", "i4", "i8", "f4", "f8", "f16", "u4")  # the last one of status words, which are always whole
_SOURCES = (
    "lanes.c",
    "steps.h",
    "curved.h",
    "elementary.h",
    "halving.h",
    "rti_step.h",
    "rti_search.h",
    "rti_lanes.h",
    "qp_search.h",
    "qp_kept.h",
)


@dataclass(frozen=True, slots=True)
class RowStep:
    """An operation on rows: its name, the row it writes, those it reads, and its literal integers."""

    function: str
    target: int
    places: tuple[int, ...]
    whole: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True)
class Ways:
    """Two places of the inputs of each lane, in their units, and on which side of an edge the first one is.

    `begin` and `there` are (lanes, m) in float64; `odd` (lanes,) tells where what is on the edge counts as below it,
    `side` where the value at `begin` is above it, `alike` where it is on the same side `there`. `scales` (m, 3) has of
    each input in fixed point the factor, the least and the most of its type. The way is halved `halvings` times.
    """

    begin: NDArray[np.float64]
    there: NDArray[np.float64]
    odd: NDArray[np.bool_]
    side: NDArray[np.bool_]
    alike: NDArray[np.bool_]
    scales: NDArray[np.float64]
    halvings: int


class _Plan(ctypes.Structure):
    _fields_ = [
        ("ops", ctypes.c_void_p),
        ("op_count", ctypes.c_int64),
        ("inputs", ctypes.c_void_p),
        ("input_count", ctypes.c_int64),
        ("states", ctypes.c_void_p),
        ("following", ctypes.c_void_p),
        ("state_count", ctypes.c_int64),
        ("tuned_count", ctypes.c_int64),
        ("results", ctypes.c_void_p),
        ("result_count", ctypes.c_int64),
        ("bits", ctypes.c_void_p),
        ("bit_count", ctypes.c_int64),
        ("courses", ctypes.c_void_p),
        ("problems", ctypes.c_void_p),
    ]


class _Array(ctypes.Structure):
    _fields_ = [("first", ctypes.c_void_p), *((name, ctypes.c_int64) for name in ("kind", "step", "column", "lane"))]


class _Way(ctypes.Structure):
    _fields_ = [
        *((name, ctypes.c_void_p) for name in ("begin", "there", "odd", "side", "alike", "scales")),
        *(("limit", ctypes.c_double), ("every", ctypes.c_double), ("halvings", ctypes.c_int64)),
        *(("near", ctypes.c_void_p), ("far", ctypes.c_void_p)),
    ]


def library() -> ctypes.CDLL | None:
    """Return the compiled code; None where this machine has no compiler that builds it."""
    try:
        return _library()
    except (ToolError, OSError):
        return None


@cache
def _library() -> ctypes.CDLL:
    return ctypes.CDLL(str(library_file()))


def library_file() -> Path:
    """Return where the compiled code is kept, built where it is not; ToolError where no compiler builds it."""
    folder = files("firmloop.verify.lanes")
    texts = {name: folder.joinpath(name).read_text(encoding="utf-8") for name in _SOURCES}
    return shared_library(texts, _SOURCES[:1], FLAGS)


class Compiled:
    """Steps on rows made ready to run: which rows are inputs, states, what these become, results and status bits."""

    def __init__(
        self,
        code: ctypes.CDLL,
        kind: np.dtype[Any],
        steps: Sequence[RowStep | Improving | Solving],
        constants: dict[int, Any],
        inputs: Sequence[int],
        states: Sequence[int],
        following: Sequence[int],
        results: Sequence[int],
        bits: Sequence[tuple[int, int]] = (),
        tuned: int = 0,
    ) -> None:
        codes = known(kind)
        self._kept_alive: list[object] = []  # what the plan points to
        rows: list[tuple[int, ...]] = []
        programs: dict[str, list[ctypes.Structure]] = {"improve": [], "solve": []}
        for s in steps:
            if isinstance(s, RowStep):
                rows.append((codes[s.function], s.target, *_filled(s.places, 4), *_filled(s.whole, 2)))
            else:
                rows.append((codes[s.function], s.target, 0, 0, 0, 0, len(programs[s.function]), 0))
                programs[s.function].append(s.read(kind, self._kept_alive))
        lists = [np.array(rows, np.int32).reshape(-1, 8), *(np.array(x, np.int32) for x in (inputs, states, following))]
        lists += [np.array(results, np.int32), np.array(bits, np.int32).reshape(-1, 2)]
        self._lists = lists  # the plan points into them
        at = [x.ctypes.data for x in lists]
        self._plan = _Plan(
            *(at[0], len(rows), at[1], len(inputs), at[2], at[3], len(states), tuned),
            *(at[4], len(results), at[5], len(bits)),
        )
        for place, given in zip(("courses", "problems"), programs.values(), strict=True):
            if given:
                several = (type(given[0]) * len(given))(*given)
                self._kept_alive.append(several)
                setattr(self._plan, place, ctypes.addressof(several))
        written = [s.target if isinstance(s, RowStep) else s.end for s in steps]
        count = 1 + max([*inputs, *states, *following, *results, *constants, *written])
        self._rows = np.zeros((count, WIDTH), kind)
        for row, value in constants.items():
            self._rows[row] = value
        self._kept = np.zeros((max(1, len(states)), WIDTH), kind)
        self._kind, self._code, self._end = kind, code, FUNCTIONS[kind.str[1:]]

    @property
    def places(self) -> tuple[int, int]:
        """Where the plan stands in memory, and the rows."""
        return ctypes.addressof(self._plan), self._rows.ctypes.data

    def results(self, inputs: Raw, state: Raw) -> Raw:
        """Return the results (steps, r, lanes) from `inputs` (steps, m, lanes) and the first `state` (n, lanes)."""
        results = np.empty((len(inputs), self._plan.result_count, inputs.shape[2]), self._kind)
        self.run(inputs, state, results)
        return results

    def run(
        self,
        inputs: Raw,
        state: Raw,
        results: Raw,
        status: Raw | None = None,
        before: Raw | None = None,
        asked: Raw | None = None,
        ranges: Raw | None = None,
    ) -> None:
        """Write the results, the status words, and where it is wanted the state before each step.

        Arrays are views (steps, columns, lanes) of any layout and type, but that the status has no columns and the
        first `state` (n, lanes) no steps. What parameters are `asked` to be before each step is refused outside of
        their `ranges` (k, 2).
        """
        steps, _, lanes = inputs.shape
        words = None if status is None else status[:, None]
        arrays = (inputs, asked, np.asarray(state).reshape(1, -1, lanes), before, results, words)
        limits = None if ranges is None else np.ascontiguousarray(ranges, self._kind)
        places = (self._rows, self._kept, limits)
        rows, kept, ends = [ctypes.c_void_p(None if x is None else x.ctypes.data) for x in places]
        sizes = (ctypes.c_int64(lanes), ctypes.c_int64(steps))
        run = getattr(self._code, f"lanes_{self._end}")
        run(ctypes.byref(self._plan), rows, kept, *sizes, ends, *[ctypes.byref(_array(x)) for x in arrays])

    def halved(self, way: Ways, limit: float, every: float, behind: Raw, state: Raw) -> tuple[Raw, Raw]:
        """Return how far on the way of each lane the last two places are between which a value passes its edge.

        The value is the first result. Its limit is the second one, or `limit` where there is only one; see `Edge` of
        `verify/stimuli/edges.py`. It is taken after the sample that moves and those `behind` it (samples, m, lanes);
        `state` (n, lanes) is the one before.
        """
        lanes = way.begin.shape[0]
        given = [np.ascontiguousarray(x) for x in (way.begin, way.there, way.odd, way.side, way.alike, way.scales)]
        found = np.empty((2, lanes))
        read = np.empty((3 * self._plan.input_count, WIDTH), self._kind)
        at = [x.ctypes.data for x in given]
        asked = _Way(*at, limit, every, way.halvings, *(x.ctypes.data for x in found))
        places = [ctypes.c_void_p(x.ctypes.data) for x in (self._rows, self._kept, read)]
        sizes = (ctypes.c_int64(lanes), ctypes.c_int64(len(behind)))
        arrays = (behind, np.asarray(state, dtype=self._kind).reshape(1, -1, lanes))
        halve = getattr(self._code, f"halve_{self._end}")
        halve(
            ctypes.byref(self._plan), *places, *sizes, ctypes.byref(asked), *[ctypes.byref(_array(x)) for x in arrays]
        )
        return found[0], found[1]


def _array(x: Raw | None) -> _Array:
    if x is None:
        return _Array(None, 0, 0, 0, 0)
    return _Array(x.ctypes.data, KINDS.index(x.dtype.str[1:]), *[by // x.itemsize for by in x.strides])


def runs(kind: np.dtype[Any], functions: Sequence[str]) -> bool:
    """Tell whether the compiled code knows all these operations on numbers of a kind."""
    return kind.str[1:] in FUNCTIONS and set(functions) <= known(kind).keys()


def _filled(given: tuple[int, ...], count: int) -> tuple[int, ...]:
    return (*given, *[0] * (count - len(given)))

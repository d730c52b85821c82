"""Cut a course into segments in which the input is a straight line, and say where outputs are read."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from firmloop.identify.plants.assembly import Timing
from firmloop.identify.simulation.course import Course

Array = NDArray[np.float64]
Slew = Callable[..., int]

_SAME = 1e-9  # of the step: moments closer than this are one
_FINEST = 2.0**-6  # of the step: shorter lengths are left as they are
_ARRAYS = ("begin", "length", "input", "ramp", "before", "reads", "read_row", "read_output")
_EVEN = 1e-6  # of the step: rows this close to even are even, and their time stamps rounded


@dataclass(frozen=True)
class Segments:
    """Segment k begins at `begin[k]`, lasts `length[k]`; its input starts at `input[k]` and changes by `ramp[k]` per s.

    `reads[k]`..`reads[k + 1]` are the readings before segment k; output -1 means all of a row.
    """

    begin: Array
    length: Array
    input: Array  # (s, m)
    ramp: Array  # (s, m)
    before: Array  # (m,)
    reads: NDArray[np.int32]  # (s + 2,)
    read_row: NDArray[np.int32]
    read_output: NDArray[np.int32]
    step: float

    @cached_property
    def addresses(self) -> Mapping[str, int]:
        """Where each array begins, by its name; they must not be moved."""
        return {name: getattr(self, name).ctypes.data for name in _ARRAYS}


def segments(course: Course, timing: Timing, delay: float, rest: float | None, outputs: int, slew: Slew) -> Segments:
    """Build the segments of rows first..end.

    `delay` is the plant's own delay of its inputs, `rest` the first of them before the recording. None: a plant that
    remembers nothing has no rest, and its inputs were before what they are in the first row.
    """
    time = course.time[course.first : course.end]
    late = delay + timing.input_delay
    value = mapped(course.drive, timing)
    lines = course.knots
    at_rest = value[0] if rest is None else mapped(still(course.drive.shape[1], rest), timing)[0]
    plain = lines is None and not (
        late or timing.output_delay or timing.stretch or len(timing.breaks) or np.isfinite(timing.slew)
    )
    if plain:
        rows = np.arange(len(time), dtype=np.int32)
        return Segments(
            time[:-1].copy(),
            snapped(np.diff(time), course.step),
            np.ascontiguousarray(value[course.first : course.end - 1]),
            np.zeros((len(time) - 1, value.shape[1])),
            value[course.first - 1] if course.first else at_rest,
            np.arange(len(time) + 1, dtype=np.int32),
            rows,
            np.full(len(time), -1, dtype=np.int32),
            course.step,
        )
    if lines is None:
        moments, values = course.time[: course.end] + late, value[: course.end]
        ramps = np.zeros_like(values)
    else:
        moments, values, ramps = _straight_lines(lines, mapped(lines[1], timing), late)
    if np.isfinite(timing.slew):
        moments, values, ramps = _slower(moments, values, ramps, at_rest, timing.slew, slew)
    stamps = _stamps(course, timing, outputs)
    last = max(float(stamp[-1]) for stamp in stamps)
    inner = np.concatenate([moments, timing.breaks])
    joined = np.sort(np.concatenate([time[:1], inner[(inner > time[0]) & (inner < last)], *stamps]))
    begin = joined[np.concatenate([[True], np.diff(joined) > _SAME * course.step])]
    piece = np.searchsorted(moments, begin + _SAME * course.step, side="right") - 1
    start = np.where(piece[:, None] >= 0, values[piece] + ramps[piece] * (begin - moments[piece])[:, None], at_rest)
    ramp = np.where(piece[:, None] >= 0, ramps[piece], 0.0)
    # A line goes through its value in the first row, where a held input has not acted yet.
    before = np.searchsorted(moments, time[0], side="left" if lines is None else "right") - 1
    opening = values[before] + ramps[before] * (time[0] - moments[before]) if before >= 0 else at_rest
    alone = bool(timing.output_delay)
    rows = np.tile(np.arange(len(time), dtype=np.int32), len(stamps))
    which = np.repeat(np.arange(len(stamps), dtype=np.int32) if alone else np.array([-1], dtype=np.int32), len(time))
    node = np.searchsorted(begin, np.concatenate(stamps) + _SAME * course.step, side="right") - 1
    order = np.argsort(node, kind="stable")
    reads = np.searchsorted(node[order], np.arange(len(begin) + 1)).astype(np.int32)
    return Segments(
        begin[:-1].copy(),
        snapped(np.diff(begin), course.step),
        np.ascontiguousarray(start[:-1]),
        np.ascontiguousarray(ramp[:-1]),
        np.ascontiguousarray(opening),
        reads,
        np.ascontiguousarray(rows[order]),
        np.ascontiguousarray(which[order]),
        course.step,
    )


def snapped(length: Array, step: float) -> Array:
    """Make lengths exact that are a row or a half, quarter ... of one, because the simulator has tables for those."""
    shares = np.exp2(np.round(np.log2(np.maximum(length / step, _FINEST))))
    exact = (shares >= _FINEST) & (shares <= 1.0) & (np.abs(length - shares * step) < _EVEN * shares * step)
    return np.where(exact, shares * step, length)


def still(inputs: int, rest: float) -> Array:
    """Return one row of inputs (1, m) of which the first is at `rest` and the others are zero."""
    return np.concatenate([[rest], np.zeros(inputs - 1)])[None, :]


def mapped(drive: Array, timing: Timing) -> Array:
    """Do to the first input what static actuator effects do; an input that is held stays held."""
    if not timing.maps:
        return drive
    value = drive.copy()
    for change, size, _, centre in timing.maps:
        value[:, 0] = centre + change(value[:, 0] - centre, size)
    return value


def _stamps(course: Course, timing: Timing, outputs: int) -> list[Array]:
    """Moments (n,) at which outputs are read, one array for all or one per output; none is before the first row."""
    time = course.time[course.first : course.end]
    origin = course.time[0]
    read = origin + (time - origin) * (1.0 + timing.stretch)
    if not timing.output_delay:
        return [np.maximum(read, time[0])]
    return [np.maximum(read - timing.output_delay.get(o, 0.0), time[0]) for o in range(outputs)]


def _slower(time: Array, value: Array, ramp: Array, rest: Array, rate: float, slew: Slew) -> tuple[Array, Array, Array]:
    """Return the straight pieces (moments, values and slopes) of inputs whose first moves no faster than `rate`."""
    begin, target, slope = (np.ascontiguousarray(each) for each in (time, value[:, 0], ramp[:, 0]))
    room = np.empty((2 * len(time), 3))
    given = (begin.ctypes.data, target.ctypes.data, slope.ctypes.data)
    kept = room[: slew(len(time), *given, rate, float(rest[0]), room.ctypes.data)]
    row = np.searchsorted(time, kept[:, 0], side="right") - 1
    values = value[row] + ramp[row] * (kept[:, 0] - time[row])[:, None]
    values[:, 0] = kept[:, 1]
    ramps = ramp[row]
    ramps[:, 0] = kept[:, 2]
    return kept[:, 0].copy(), values, ramps


def _straight_lines(lines: tuple[Array, Array], value: Array, late: float) -> tuple[Array, Array, Array]:
    """Moments, values and slopes of inputs that go from knot to knot; the last one is held."""
    time = lines[0]
    slopes = np.diff(value, axis=0) / np.diff(time)[:, None]
    return time + late, value, np.concatenate([slopes, np.zeros((1, value.shape[1]))])


def slew_function(library: ctypes.CDLL) -> Slew:
    """Return the compiled limit_slew of driver/segments.c."""
    function = library.limit_slew
    function.restype = ctypes.c_int
    array, real = ctypes.c_void_p, ctypes.c_double
    function.argtypes = [ctypes.c_int, array, array, array, real, real, array]
    return function

"""Condition signals before they are compared: offset, trend, lines, smoothing, resampling, time alignment.

Whatever is done to a measured output is done to the model's output too before the two are subtracted. All of it is
linear, so a model that is right leaves the conditioned noise and nothing else: conditioning can hide detail, but it
cannot bias a parameter. (Smoothing only the measurement, the usual shortcut, makes every lag look longer.)
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise

import numpy as np
import scipy
from numpy.typing import NDArray

from firmloop.identify.error import IdentifyError

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Conditioning:
    """What is done to the signals of every recording; the default is nothing.

    An input named in `remove_offset` loses its mean before it drives the model. Windows keep a plant that integrates,
    a carriage or an angle, from piling up small errors until they hide the rest; everything else is then done window
    by window. A clock difference between the input
    and an output named in `align` is found by cross-correlation with the model's output.
    """

    remove_offset: tuple[str, ...] = ()
    detrend: tuple[str, ...] = ()  # outputs that lose their best straight line
    savgol_window: int = 0  # rows, odd; 0 for none (Savitzky and Golay, 1964)
    savgol_order: int = 2
    resample_s: float = 0.0  # period of the grid that outputs are compared on; 0 for the rows as they are
    align: tuple[str, ...] = ()
    align_max_lag_s: float = 0.0
    line_Hz: float = 0.0  # mains frequency whose lines are taken out; 0 for none
    line_harmonics: int = 5  # how many multiples of it
    window_s: float = 0.0  # length of windows that each get an initial state of their own; 0 for one start


NONE = Conditioning()

_LISTS = ("remove_offset", "detrend", "align")
# A filter of more rows or orders loses all its digits, and harmonics beyond these are noise.
MOST = {"savgol_window": 100_001, "savgol_order": 20, "line_harmonics": 100}
MOST_PARTS = 1_000_000  # that a recording is cut into
_FINER, _FEW_PARTS = 10, 100_000  # moments for each row that it is resampled to: more show nothing more; and for all
_WHOLE = tuple(MOST)
_SECONDS = ("resample_s", "align_max_lag_s", "window_s", "line_Hz")


def conditioning_from_table(table: Mapping[str, object]) -> Conditioning:
    """Check the project's `[recordings.conditioning]`; IdentifyError names the key and the rule."""
    where = "recordings.conditioning"
    lists: dict[str, tuple[str, ...]] = {}
    whole: dict[str, int] = {}
    seconds: dict[str, float] = {}
    for key, value in table.items():
        if key in _LISTS:
            if not isinstance(value, list | tuple) or not all(isinstance(name, str) for name in value):
                raise IdentifyError(f"{where}.{key} is {value!r}; it must be a list of signal names")
            lists[key] = tuple(value)
        elif key in _WHOLE:
            if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value <= MOST[key]:
                raise IdentifyError(
                    f"{where}.{key} is {value!r}; it must be a whole number of rows or orders, at most {MOST[key]}"
                )
            whole[key] = value
        elif key in _SECONDS:
            if isinstance(value, bool) or not isinstance(value, int | float) or not 0.0 < value < float("inf"):
                raise IdentifyError(f"{where}.{key} is {value!r}; it must be a positive number of {_unit(key)}")
            seconds[key] = float(value)
        else:
            known = ", ".join((*_LISTS, *_WHOLE, *_SECONDS))
            raise IdentifyError(f"{where}.{key} is unknown; known: {known}")
    made = Conditioning(
        remove_offset=lists.get("remove_offset", ()),
        detrend=lists.get("detrend", ()),
        savgol_window=whole.get("savgol_window", 0),
        savgol_order=whole.get("savgol_order", 2),
        resample_s=seconds.get("resample_s", 0.0),
        align=lists.get("align", ()),
        align_max_lag_s=seconds.get("align_max_lag_s", 0.0),
        line_Hz=seconds.get("line_Hz", 0.0),
        line_harmonics=whole.get("line_harmonics", 5),
        window_s=seconds.get("window_s", 0.0),
    )
    if made.savgol_window and (made.savgol_window % 2 == 0 or made.savgol_window <= made.savgol_order):
        raise IdentifyError(
            f"{where}.savgol_window is {made.savgol_window}; it must be odd and larger than savgol_order, "
            f"which is {made.savgol_order}"
        )
    if made.align and not made.align_max_lag_s:
        raise IdentifyError(f"{where}.align needs align_max_lag_s, the largest clock difference to look for, in s")
    return made


def _unit(key: str) -> str:
    return "hertz" if key.endswith("_Hz") else "seconds"


def windows(conditioning: Conditioning, time: Array, fewest: int) -> tuple[tuple[int, int], ...]:
    """Cut rows into windows of about `window_s`: (first row, row after the last) of each, at least `fewest` rows."""
    asked = (time[-1] - time[0]) / conditioning.window_s if conditioning.window_s else 1.0
    count = max(round(min(asked, float(len(time)))), 1)  # no more than rows: a window holds some
    edges = time[0] + (time[-1] - time[0]) * np.arange(1, count) / count
    cuts = [0]
    for row in np.searchsorted(time, edges).tolist():
        if row - cuts[-1] >= fewest and len(time) - row >= fewest:
            cuts.append(row)
    return tuple(pairwise([*cuts, len(time)]))


def compared_time(conditioning: Conditioning, time: Array) -> Array:
    """Instants (q,) in s at which outputs are compared."""
    if not conditioning.resample_s:
        return time
    count = int(np.floor((time[-1] - time[0]) / conditioning.resample_s * (1.0 + 1e-12))) + 1
    return np.asarray(time[0] + conditioning.resample_s * np.arange(count))


def condition_output(conditioning: Conditioning, name: str, time: Array, values: Array) -> Array:
    """Condition one output: values (n, ...) at `time` become (q, ...) at `compared_time`. Linear in `values`.

    Of a simulation that has diverged nothing is a number: filters would stop at its infinities.
    """
    grid = compared_time(conditioning, time)
    if not np.all(np.isfinite(values)):
        return np.full((len(grid), *values.shape[1:]), np.nan)
    done: Array = interpolate(time, values, grid) if conditioning.resample_s else values
    if conditioning.line_Hz:
        done = line_free(conditioning, grid, done)
    if conditioning.savgol_window:
        done = _smoothed(conditioning.savgol_window, conditioning.savgol_order, done)
    if name in conditioning.detrend:
        line = np.column_stack([np.ones(len(grid)), grid - grid.mean()])
        basis, _ = np.linalg.qr(line)
        done = done - np.tensordot(basis, np.tensordot(basis.T, done, 1), 1)
    if name in conditioning.remove_offset:
        done = done - done.mean(axis=0)
    return np.asarray(done, dtype=np.float64)


def uncoloured(conditioning: Conditioning, time: Array) -> Conditioning:
    """Leave out what gives white noise a memory: smoothing, and a grid so fine that its points share rows."""
    finest = 2.0 * float(np.max(np.diff(time)))
    coarse = conditioning.resample_s if conditioning.resample_s >= finest else 0.0
    return replace(conditioning, savgol_window=0, resample_s=coarse)


def line_free(conditioning: Conditioning, grid: Array, values: Array) -> Array:
    """Take the mains' harmonics out of values (q, ...) at the instants `grid` (q,) in s."""
    basis = _line_basis(conditioning.line_Hz, conditioning.line_harmonics, np.ascontiguousarray(grid).tobytes())
    return np.asarray(values - np.tensordot(basis, np.tensordot(basis.T, values, 1), 1))


@lru_cache(maxsize=64)
def _line_basis(frequency: float, harmonics: int, instants: bytes) -> Array:
    """Orthonormal sines and cosines (q, 2 h) of the harmonics that the instants can show.

    Kept, because a fit conditions the same rows hundreds of times.
    """
    grid = np.frombuffer(instants, dtype=np.float64)
    fastest = 0.5 / float(np.median(np.diff(grid)))
    turns = 2.0 * np.pi * frequency * (grid - grid[0])
    orders = [k for k in range(1, harmonics + 1) if k * frequency < fastest]
    waves = [wave(k * turns) for k in orders for wave in (np.sin, np.cos)]
    basis, _ = np.linalg.qr(np.column_stack(waves)) if waves else (np.zeros((len(grid), 0)), None)
    return np.asarray(basis)


def _smoothed(window: int, order: int, values: Array) -> Array:
    """Take each of values (q, ...) from the polynomial through the rows around it, those of the ends from the last one.

    As scipy.signal.savgol_filter does, which fits the polynomials of the ends anew each time.
    """
    basis = _polynomials(window, order)
    half = window // 2
    smooth = scipy.ndimage.correlate1d(values, basis @ basis[half], axis=0, mode="constant")
    smooth[:half] = np.tensordot(basis[:half], np.tensordot(basis.T, values[:window], 1), 1)
    smooth[len(values) - half :] = np.tensordot(basis[window - half :], np.tensordot(basis.T, values[-window:], 1), 1)
    return np.asarray(smooth)


@lru_cache(maxsize=8)
def _polynomials(window: int, order: int) -> Array:
    """Orthonormal polynomials (window, order + 1) over so many even rows."""
    basis, _ = np.linalg.qr(np.polynomial.legendre.legvander(np.linspace(-1.0, 1.0, window), order))
    return np.asarray(basis)


def condition_input(conditioning: Conditioning, name: str, values: Array) -> Array:
    """Condition one input (n,) before it drives the model."""
    return np.asarray(values - values.mean()) if name in conditioning.remove_offset else values


def check_parts(conditioning: Conditioning, source: str, time: Array) -> None:
    """Raise IdentifyError where a whole recording, of rows at `time`, would be cut into too many windows or moments."""
    duration = float(time[-1] - time[0])
    for key, most in (("window_s", MOST_PARTS), ("resample_s", max(_FINER * len(time), _FEW_PARTS))):
        length = getattr(conditioning, key)
        if length and duration / length > most:
            raise IdentifyError(
                f"recordings.conditioning.{key} is {length:g}: cuts the {duration:g} s and {len(time):,} rows of "
                f"{source} into {duration / length:.3g} parts; at most {most:,}: make it longer"
            )


def check_conditioning(conditioning: Conditioning, names: tuple[str, ...], source: str, time: Array) -> None:
    """Raise IdentifyError where `conditioning` does not fit a recording."""
    where = "recordings.conditioning"
    for key in _LISTS:
        for name in getattr(conditioning, key):
            if name not in names:
                raise IdentifyError(f"{where}.{key}: {name} is no signal of the plant, which has {', '.join(names)}")
    grid = compared_time(conditioning, time)
    rows = len(grid)
    if conditioning.line_Hz:
        cycles, fastest = conditioning.line_Hz * float(grid[-1] - grid[0]), 0.5 / float(np.median(np.diff(grid)))
        if cycles < 5.0 or conditioning.line_Hz >= fastest:
            raise IdentifyError(
                f"{where}.line_Hz is {conditioning.line_Hz:g}: {source} holds {cycles:.2g} cycles and shows up to "
                f"{fastest:g} Hz; at least 5 cycles below that are needed to tell a line from the response"
            )
    if rows < max(3, conditioning.savgol_window):
        raise IdentifyError(f"{where}: {source} leaves {rows} rows to compare; shorten resample_s or savgol_window")
    distances = np.diff(time)
    if conditioning.savgol_window and not conditioning.resample_s and distances.max() > 1.5 * distances.min():
        raise IdentifyError(
            f"{where}.savgol_window needs even rows, but those of {source} are {distances.min():g} to "
            f"{distances.max():g} s apart; add resample_s"
        )


def interpolate(time: Array, values: Array, moments: Array) -> Array:
    """Values (n, ...) at `time`, read at `moments` along straight lines; the ends hold beyond."""
    right = np.clip(np.searchsorted(time, moments, side="right"), 1, len(time) - 1)
    share = np.clip((moments - time[right - 1]) / (time[right] - time[right - 1]), 0.0, 1.0)
    share = share.reshape(-1, *(1,) * (values.ndim - 1))
    return np.asarray(values[right - 1] * (1.0 - share) + values[right] * share)


def find_lag(time: Array, measured: Array, simulated: Array, longest: float) -> float:
    """Return how many seconds `measured` comes after `simulated` (both (n,)): the peak of their cross-correlation.

    The middle of the simulation is laid over the measurement at every lag, and each overlap is normalized by its own
    mean and energy, so that a signal that drifts does not pull the peak. The peak is refined by a parabola through its
    neighbours; zero where either signal does not move.
    """
    step = float(np.median(np.diff(time)))
    grid = np.arange(time[0], time[-1], step)
    late, early = (interpolate(time, values - values.mean(), grid) for values in (measured, simulated))
    reach = min(int(np.ceil(longest / step)) + 1, (len(grid) - 3) // 4)
    template = early[reach : len(grid) - reach]
    template = template - template.mean()
    rows = scipy.fft.next_fast_len(len(late), real=True)
    spectrum = scipy.fft.rfft(late, rows) * np.conj(scipy.fft.rfft(template, rows))
    product = scipy.fft.irfft(spectrum, rows)[: len(late) - len(template) + 1]  # as far as nothing wraps around
    sums, energies = (np.cumsum(np.concatenate([[0.0], late**power])) for power in (1, 2))
    size = len(template)
    spread = energies[size:] - energies[:-size] - (sums[size:] - sums[:-size]) ** 2 / size
    if not np.any(template) or not np.all(spread > 1e-12 * energies[-1]):
        return 0.0
    likeness = product / np.sqrt(spread)
    peak = int(np.argmax(likeness))
    shift = 0.0
    if 0 < peak < len(likeness) - 1:
        before, top, after = likeness[peak - 1 : peak + 2]
        bend = before - 2.0 * top + after
        shift = 0.5 * float((before - after) / bend) if bend < 0.0 else 0.0
    return float(np.clip((peak - reach + shift) * step, -longest, longest))

"""Signals that excite a plant on the bench; every module of this folder with a `SIGNAL` is one."""

from __future__ import annotations

import importlib
import math
import pkgutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from firmloop.identify.error import IdentifyError

Array = NDArray[np.float64]

MOST_SAMPLES = 1_000_000
SHARED_KEYS = ("signal", "low", "high", "period_s", "duration_s", "repeats", "rest_s")


@dataclass(frozen=True, slots=True)
class ExcitationRequest:
    """What a signal is asked for: between `low` and `high`, `samples` of `period` s; `table` holds its own keys."""

    low: float
    high: float
    period: float  # s
    samples: int
    table: Mapping[str, object]

    def positive(self, key: str, default: float) -> float:
        """Read one of the signal's own keys as a number above 0."""
        value = self.table.get(key, default)
        if isinstance(value, bool) or not isinstance(value, int | float) or not 0.0 < value < math.inf:
            raise IdentifyError(f"experiment.{key} is {value!r}; it must be a number above 0")
        return float(value)

    def whole(self, key: str, default: int, low: int, high: int) -> int:
        """Read one of the signal's own keys as a whole number."""
        value = self.table.get(key, default)
        if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
            raise IdentifyError(f"experiment.{key} is {value!r}; it must be a whole number from {low} to {high}")
        return value

    @property
    def duration(self) -> float:
        """Length in s."""
        return self.samples * self.period

    @property
    def time(self) -> Array:
        """Instants (n,) in s."""
        return np.arange(self.samples, dtype=np.float64) * self.period


@dataclass(frozen=True, slots=True)
class Excitation:
    """One signal: `make` returns its samples (n,), each held for a period; `keys` are its own."""

    name: str
    says: str
    keys: tuple[str, ...]
    make: Callable[[ExcitationRequest], Array]


@cache
def excitations() -> Mapping[str, Excitation]:
    """Every signal of this folder, by name."""
    modules = [importlib.import_module(f"{__name__}.{found.name}") for found in pkgutil.iter_modules(__path__)]
    return {module.SIGNAL.name: module.SIGNAL for module in modules}


def excitation(table: Mapping[str, object]) -> tuple[Array, Array]:
    """Make the signal that `[experiment]` asks for: time (n,) in s and values (n,).

    `repeats` plays it as often, with `rest_s` of 0 (or the end nearest to it) before each, so that every trial begins
    at rest. Raises IdentifyError naming the key that is wrong.
    """
    name = table.get("signal")
    if not isinstance(name, str) or name not in excitations():
        raise IdentifyError(f"experiment.signal is {name!r}; known: {', '.join(excitations())}")
    kind = excitations()[name]
    for key in table:
        if key not in (*SHARED_KEYS, *kind.keys):
            raise IdentifyError(
                f"experiment.{key} is unknown to signal = '{kind.name}'; it has {', '.join((*SHARED_KEYS, *kind.keys))}"
            )
    for key in ("low", "high", "period_s", "duration_s"):
        if key not in table:
            raise IdentifyError(
                f"experiment.{key} is missing; give low and high of the signal, period_s and duration_s"
            )
    low, high = (_number(table, key) for key in ("low", "high"))
    if not low < high:
        raise IdentifyError(f"experiment.low is {low:g} and high {high:g}; low must be below high")
    bare = ExcitationRequest(low, high, 1.0, 1, table)
    period, duration = bare.positive("period_s", 0.0), bare.positive("duration_s", 0.0)
    samples, repeats = round(duration / period), bare.whole("repeats", 1, 1, 1000)
    rest = round(bare.positive("rest_s", duration / 10) / period) if "rest_s" in table or repeats > 1 else 0
    if samples < 8 or (samples + rest) * repeats > MOST_SAMPLES:
        raise IdentifyError(
            f"experiment.duration_s is {duration:g} and period_s {period:g}: that makes {samples} samples, {repeats} "
            f"times; it must be at least 8 and at most {MOST_SAMPLES} in all"
        )
    once = np.clip(kind.make(ExcitationRequest(low, high, period, samples, table)), low, high)
    if np.ptp(once) == 0.0:
        raise IdentifyError(
            f"experiment.duration_s is {duration:g}: within its {samples} samples of {period:g} s {name} never moves; "
            "play it for longer"
        )
    quiet = np.full(rest, min(max(0.0, low), high))
    values = np.concatenate([part for _ in range(repeats) for part in (quiet, once)])
    return np.arange(len(values), dtype=np.float64) * period, np.asarray(values, dtype=np.float64)


def _number(table: Mapping[str, object], key: str) -> float:
    value = table[key]
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise IdentifyError(f"experiment.{key} is {value!r}; it must be a number")
    return float(value)

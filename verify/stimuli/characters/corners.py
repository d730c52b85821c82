"""Special values of range and type, held for a few steps each."""

from __future__ import annotations

from typing import Any

import numpy as np

from firmloop.quantize.program import Program, Value
from firmloop.verify.reference import Raw, element_type
from firmloop.verify.stimuli.stimulus import Stimulus


def corners(program: Program, random: np.random.Generator, lanes: int, length: int) -> Raw:
    """Hold special values of range and type for one to thirty steps each."""
    columns: list[Any] = []
    for value in program.inputs:
        special = _special(value)
        new = random.random((lanes, length)) < random.uniform(1 / 30, 1.0, size=(lanes, 1))
        new[:, 0] = True
        picks = random.integers(len(special), size=(lanes, length))
        last = np.maximum.accumulate(np.where(new, np.arange(length), 0), axis=1)
        columns.append(special[np.take_along_axis(picks, last, axis=1)])
    return np.stack(columns, axis=-1)


def _special(value: Value) -> Raw:
    kind = element_type(value.number)
    low, high = value.low, value.high
    if value.number.kind == "fixed":
        limits = np.iinfo(kind)
        raw = [0, 1, -1, low, high, low + 1, high - 1, low - 1, high + 1, limits.min, limits.max, (low + high) / 2]
        whole: Raw = np.clip(np.array(raw), limits.min, limits.max).astype(kind)
        return whole
    tiny = float(np.finfo(kind).smallest_subnormal)
    inner = [0.0, -0.0, tiny, -tiny, low, high, (low + high) / 2, low / 3, high / 3]
    outer = [np.inf, -np.inf, np.nan, float(np.finfo(kind).max), low * 2, high * 2, np.finfo(kind).tiny]
    with np.errstate(over="ignore"):
        special = np.array(inner * 2 + outer, dtype=np.float64)
        return special.astype(kind)


STIMULUS = Stimulus("corners", 2, 20, corners, single_steps=True)

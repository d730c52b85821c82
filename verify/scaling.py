"""Convert samples between the unit of an input or output and its raw type."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from firmloop.quantize.program import Value
from firmloop.verify.reference import Raw, element_type

Array = NDArray[np.float64]


def to_raw(value: Value, physical: Array) -> Raw:
    """Round physical samples into the type of one input, saturating at what the type holds."""
    kind = element_type(value.number)
    if value.number.kind == "float":
        with np.errstate(over="ignore"):
            return physical.astype(kind)
    factor, least, most = reading(value)
    return np.clip(np.floor(physical * factor + 0.5), least, most).astype(kind)


def reading(value: Value) -> tuple[float, float, float]:
    """Return the factor by which an input in fixed point is read, and the least and the most that its type holds."""
    if value.number.kind == "float":
        return 1.0, -np.inf, np.inf
    limits = np.iinfo(element_type(value.number))
    return 2.0**value.number.fraction, float(limits.min), float(limits.max)


def to_physical(value: Value, raw: Raw) -> Array:
    """Return raw samples in the input's or output's unit."""
    if value.number.kind == "float":
        return raw.astype(np.float64)
    return raw.astype(np.float64) * 2.0**-value.number.fraction

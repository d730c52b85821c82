"""Pack the inputs of steps and what their parameters shall be, as the far end of a link reads them."""

from __future__ import annotations

import math

import numpy as np

from firmloop.quantize.program import Program, Value
from firmloop.verify.reference import Raw, element_type, start_parameters


def records(program: Program, inputs: Raw, settings: Raw | None) -> bytes:
    """Pack the inputs (..., m) and requests (..., k) of steps in order, as the far end of a link reads them."""
    if not program.tunable:
        return np.ascontiguousarray(inputs).tobytes()
    flat = np.ascontiguousarray(inputs).reshape(-1, inputs.shape[-1])
    if settings is None:
        asked = untouched(program, 1, len(flat))[0]
    else:
        asked = np.ascontiguousarray(settings).reshape(-1, settings.shape[-1])
    parts = [np.ascontiguousarray(part).view(np.uint8).reshape(len(flat), -1) for part in (flat, asked)]
    return np.concatenate(parts, axis=1).tobytes()


def untouched(program: Program, lanes: int, steps: int) -> Raw:
    """Return requests (lanes, steps, k) that leave every parameter as init() sets it.

    The setter refuses them, so that what init() sets shows; only a range of the whole type leaves it none to refuse.
    """
    starts = start_parameters(program)
    refused = [_refused(value, start) for value, start in zip(program.parameters, starts, strict=True)]
    return np.broadcast_to(np.array(refused, dtype=starts.dtype), (lanes, steps, len(starts))).copy()


def _refused(value: Value, start: float) -> float:
    if value.number.kind == "float":
        return math.nan
    limits = np.iinfo(element_type(value.number))
    beyond = [x for x in (value.high + 1, value.low - 1) if limits.min <= x <= limits.max]
    return beyond[0] if beyond else start

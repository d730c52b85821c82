"""First samples that bring a value of a program to the edge of a limit: on it, or next to it on either side.

A limit that is wrong by one unit in the last place shows nowhere else.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from quantize.ops import LIMITS
from quantize.program import Program, Value
from verify.reference import Machine, Raw, start_state, working_type

Array = NDArray[np.float64]
Convert = Callable[[Value, Array], Raw]
HALVINGS = 64  # of the way from one input to the other: to neighbors in any format


def limits(program: Program) -> list[tuple[str, float]]:
    """Return each value that an operation limits, with the limit."""
    found = []
    for op in program.body:
        if op.function in (*LIMITS, "min", "max") and isinstance(op.arguments[0], str):
            found += [(op.arguments[0], float(a)) for a in op.arguments[1:] if not isinstance(a, str)]
    return found


def edges(program: Program, random: np.random.Generator, lanes: int, length: int, convert: Convert) -> Raw:
    """Return inputs (lanes, length, m): noise, but the first sample of a lane at an edge where a way across was found.

    `convert` rounds physical values into the type of an input.
    """
    spans = [(v.low * 2.0**-v.number.fraction, v.high * 2.0**-v.number.fraction) for v in program.inputs]
    noise = np.stack([random.uniform(*span, size=(lanes, length)) for span in spans], axis=-1)
    wanted = limits(program)
    if wanted:
        here, there = (np.stack([random.uniform(*span, size=lanes) for span in spans], axis=-1) for _ in range(2))
        which = random.integers(len(wanted), size=lanes)
        near, far = np.zeros((lanes, 1)), np.ones((lanes, 1))
        side = _above(program, wanted, which, here, convert)
        for _ in range(HALVINGS):
            middle = (near + far) / 2
            same = (_above(program, wanted, which, here + middle * (there - here), convert) == side)[:, None]
            near, far = np.where(same, middle, near), np.where(same, far, middle)
        noise[:, 0] = here + np.where(random.random((lanes, 1)) < 0.5, near, far) * (there - here)
    return np.stack([convert(v, noise[..., j]) for j, v in enumerate(program.inputs)], axis=-1)


def _above(
    program: Program, wanted: list[tuple[str, float]], which: NDArray[np.int64], inputs: Array, convert: Convert
) -> NDArray[np.bool_]:
    """Tell of each lane whether its value is above its limit in the first sample, of every other lane: or on it."""
    machine, kind = Machine(program), working_type(program)
    row = [convert(v, inputs[:, j]).astype(kind) for j, v in enumerate(program.inputs)]
    with np.errstate(all="ignore"):
        named = machine.named(machine.step(row, start_state(program, len(inputs))))
    values = np.stack([np.broadcast_to(named[name], len(inputs)).astype(np.float64) for name, _ in wanted])
    own = values[which, np.arange(len(inputs))]
    limit = np.array([limit for _, limit in wanted])[which]
    return np.where(np.arange(len(inputs)) % 2, own > limit, own >= limit)

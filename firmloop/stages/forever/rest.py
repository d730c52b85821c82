"""Find where a loop of a program and a sampled plant comes to rest: by running it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from firmloop.quantize.program import Program
from firmloop.verify.proofs.forever.ring import middle
from firmloop.verify.proofs.forever.sampled import Rows, SampledPlants
from firmloop.verify.proofs.forever.stated import Stated
from firmloop.verify.reference import Machine, start_state

Array = NDArray[np.float64]

LONGEST = 20_000  # samples until it should have come to rest
SAME = 1e-12


def settled(program: Program, stated: Stated, plant: SampledPlants) -> Array:
    """Return plant, past inputs (newest first) and the program's words after a while at the reference's rest."""
    a, c, read_x, read_c = (
        numbers(plant.a), numbers([plant.c])[0], numbers(plant.read_x), numbers([plant.read_c])[0],
    )  # fmt: skip
    taps, reads = ({age: numbers(rows) for age, rows in part.items()} for part in (plant.taps, plant.reads))
    past = np.zeros((max((*taps, *reads), default=0) + 1, len(stated.drives)))
    machine, x, words = Machine(program), np.zeros(len(a)), start_state(program, 1)
    names = [value.name for value in program.outputs]
    driving = [(names.index(name), program.outputs[names.index(name)].number.fraction) for name in stated.drives]
    for _ in range(LONGEST):
        y = read_x @ x + read_c + sum((part @ past[age - 1] for age, part in reads.items()), np.zeros(len(read_c)))
        values = machine.step(_told(program, stated, y), words)
        now = np.array([float(np.ravel(values[machine.results[k]])[0]) * 2.0**-places for k, places in driving])
        after = [np.broadcast_to(values[name], 1) for name in machine.next]
        older = np.vstack([now, past[:-1]])
        next_x = a @ x + c + sum((part @ older[age] for age, part in taps.items()), np.zeros(len(a)))
        rests = np.allclose(next_x, x, rtol=SAME, atol=SAME) and np.array_equal(older, past)
        still = rests and all(np.array_equal(one, other) for one, other in zip(after, words, strict=True))
        x, words, past = next_x, after, older
        if still:
            break
    kept = len(program.state) - len(program.tunable)
    return np.concatenate([x, past[:-1].ravel(), [float(word[0]) for word in words[:kept]]])


def _told(program: Program, stated: Stated, y: Array) -> list[NDArray[np.int64]]:
    told = []
    for value in program.inputs:
        seen = 0.0
        if value.name == stated.reference:
            seen = float(stated.rest_reference)
        elif value.name in stated.measured:
            seen = float(y[stated.measured[value.name]])
        raw = np.clip(np.floor(seen * 2.0**value.number.fraction + 0.5), value.low, value.high)
        told.append(np.array([raw], dtype=np.int64))
    return told


def numbers(rows: Rows) -> Array:
    """Return the middles of intervals as floats."""
    return np.array([[float(middle(entry)) for entry in row] for row in rows])

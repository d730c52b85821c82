"""A Delivery: generated C, and golden vectors of it, from which the files of a user's build are printed."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from firmloop.codegen.bundle import Bundle
from firmloop.quantize.program import Program

Raw = NDArray[Any]
Row = tuple[int, Raw, Raw, Raw, int]  # 1 where init() comes before the step, inputs, settings, outputs, status

FLAGS = ("-std=c99", "-Wall", "-Wextra", "-ffp-contract=off")


@dataclass(frozen=True, slots=True)
class Delivery:
    """What every package format prints from.

    `inputs` (lanes, steps, m), `settings` (lanes, steps, k) what each parameter is asked to be before the step,
    `outputs` (lanes, steps, r), `status` (lanes, steps): raw values as the reference computed them, each lane from
    init(); `command` is the command line that makes the files again.
    """

    program: Program
    bundle: Bundle
    command: str
    inputs: Raw
    settings: Raw
    outputs: Raw
    status: NDArray[np.uint32]

    def rows(self) -> Iterator[Row]:
        """Yield the golden vectors step by step."""
        for lane in range(len(self.inputs)):
            for step in range(self.inputs.shape[1]):
                at = lane, step
                yield int(step == 0), self.inputs[at], self.settings[at], self.outputs[at], int(self.status[at])

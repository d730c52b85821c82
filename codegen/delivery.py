"""A Delivery: generated C, and golden vectors of it, from which the files of a user's folder are printed.

The folder is laid out as build systems expect it: `src/` holds all that firmware needs, `test/` the only main().
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from firmloop.codegen.bundle import Bundle
from firmloop.codegen.environment import c_comment
from firmloop.quantize.program import Program

Raw = NDArray[Any]
Row = tuple[int, Raw, Raw, Raw, int]  # 1 where init() comes before the step, inputs, settings, outputs, status

CONTRACT = "-ffp-contract=off"  # a fused multiply-add rounds once where the reference rounds twice
FLAGS = ("-std=c99", "-Wall", "-Wextra", CONTRACT)
VERSION = "1.0.0"  # of every package; which program it is, its id tells


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

    @property
    def sources(self) -> tuple[str, ...]:
        """The C files, as they lie in the folder."""
        return tuple(f"src/{name}" for name in self.bundle.sources)

    @property
    def headers(self) -> tuple[str, ...]:
        """The headers, as they lie in the folder."""
        return tuple(f"src/{name}" for name in self.bundle.headers)

    @property
    def says(self) -> str:
        """One sentence about the controller, in signs that every manifest takes."""
        return c_comment(
            f"{self.program.name}: a controller as C, {self.program.arithmetic}, a step every {self.program.period:g} s"
        )

    def rows(self) -> Iterator[Row]:
        """Yield the golden vectors step by step."""
        for lane in range(len(self.inputs)):
            for step in range(self.inputs.shape[1]):
                at = lane, step
                yield int(step == 0), self.inputs[at], self.settings[at], self.outputs[at], int(self.status[at])

"""A Program: the exact arithmetic of one controller, operation by operation. THE intermediate representation.

Every value is assigned once, carries a unit, a number format and bounds it was proven to stay within. The bit-exact
reference (`verify/reference.py`) runs it, the templates print it, and nobody downstream needs to know what a PID is.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, dataclass
from typing import Literal

from firmloop.quantize.shifts import wrong_count, wrong_sizes

TOO_FAR = "the ranges of the law are too far apart for fixed point: rescale the signals' units or use float32"


SOLVING = ("solve", "sweeps", "tree", "improve")  # operations


class QuantizeError(Exception):
    """The law does not fit the number format; the message names the value, its range and the way out."""


@dataclass(frozen=True, slots=True)
class Number:
    """A number format. fixed: physical = raw * 2**-fraction in a signed word of `bits`; float: IEEE 754, fraction 0."""

    kind: Literal["fixed", "float"]
    bits: int
    fraction: int


@dataclass(frozen=True, slots=True)
class Value:
    """One named value. `low` and `high` are proven bounds: raw integers in fixed point, physical in float."""

    name: str
    unit: str
    number: Number
    low: float
    high: float


@dataclass(frozen=True, slots=True)
class Op:
    """`result = function(arguments)`; an argument is the name of an earlier value or a literal (raw in fixed point)."""

    result: Value
    function: str
    arguments: tuple[str | int | float, ...]

    def __post_init__(self) -> None:
        """Refuse a shift that C leaves undefined, whoever makes the operation."""
        wrong = wrong_count(self.function, self.arguments)
        if wrong:
            raise QuantizeError(f"{self.result.name}: {wrong}; {TOO_FAR}")


@dataclass(frozen=True, slots=True)
class Table:
    """Constant data of one operation, read by it as the argument `table.<name>`, as its C structure `form` has it.

    `support` is the C file that defines `form` and is told the `sizes`, enumerators; `numbers` are its members, lists
    or single numbers.
    """

    name: str
    says: str
    form: str
    support: str
    sizes: tuple[tuple[str, int], ...]
    numbers: tuple[tuple[str, tuple[float, ...] | float], ...]

    def __post_init__(self) -> None:
        """Refuse a shift that C leaves undefined."""
        wrong = wrong_sizes(self.sizes)
        if wrong:
            raise QuantizeError(f"{self.name}: {wrong}; {TOO_FAR}")


@dataclass(frozen=True, slots=True)
class Assign:
    """After the body has run, value `source` becomes the state or output `target`."""

    target: str
    source: str


@dataclass(frozen=True, slots=True)
class StatusBit:
    """Bit `bit` of what step() returns: the truth value `source` (0 or 1)."""

    name: str
    says: str
    bit: int
    source: str


@dataclass(frozen=True, slots=True)
class Rounding:
    """Proven bound on |program - law| of one output in one step from the same state and inputs, in its unit."""

    output: str
    bound: float
    unit: str


@dataclass(frozen=True, slots=True)
class Program:
    """A controller as single-assignment operations over bounded values."""

    name: str
    says: str
    period: float  # s
    arithmetic: str  # "float32", "float64", "fixed32", "fixed16"
    inputs: tuple[Value, ...]
    outputs: tuple[Value, ...]
    state: tuple[Value, ...]
    start: tuple[int | float, ...]  # raw, one per state
    body: tuple[Op, ...]
    next_state: tuple[Assign, ...]
    results: tuple[Assign, ...]
    status: tuple[StatusBit, ...]
    rounding: tuple[Rounding, ...]
    tables: tuple[Table, ...] = ()
    routines: tuple[Program, ...] = ()  # without state; an operation calls one as its argument `routine.<name>`
    unset: str | None = None  # state that starts at the least integer, or as no number, until the first sample sets it
    tunable: tuple[str, ...] = ()  # state that a step keeps and a user may set within its range, the last of `state`
    safe: tuple[float, ...] = ()  # of a float: each output where the last status bit tells that an input is no number
    rounds: str = "nearest"  # what fixed point does with the places that it drops: "nearest" or "floor"

    @property
    def parameters(self) -> tuple[Value, ...]:
        """The values that can be set on the running controller."""
        return self.state[len(self.state) - len(self.tunable) :]

    @property
    def solves(self) -> bool:
        """Whether a step solves a program: it takes long, and a search in it has a course of its own."""
        return any(op.function in SOLVING for op in self.body)

    @property
    def id(self) -> str:
        """64 bits of the SHA-256 of everything above, as 16 hexadecimal digits."""
        told = asdict(self)
        for key, usual in (("tables", ()), ("routines", ()), ("safe", ()), ("rounds", "nearest")):
            if told[key] == usual:
                del told[key]
        text = json.dumps(told, sort_keys=True, separators=(",", ":"))
        return hashlib.sha256(text.encode()).hexdigest()[:16]

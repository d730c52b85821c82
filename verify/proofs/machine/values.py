"""What a bit-vector term is, and what it gives for values of its variables, many at once."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Words = NDArray[np.uint64]  # one value of a term for each sample


@dataclass(frozen=True, slots=True, eq=False)
class BitTerm:
    """`op` of `args`; `data` is the value of a constant, the name of a variable, the lowest bit of an extract."""

    op: str
    width: int  # bits
    args: tuple[BitTerm, ...]
    data: int | str
    number: int  # in the order of making: above those of its arguments

    @property
    def value(self) -> int | None:
        """The value of a constant, None of anything else."""
        return int(self.data) if self.op == "const" else None


def applied(op: str, width: int, values: Sequence[Words], widths: Sequence[int], data: int) -> Words:
    """Return what `op` gives for values of its arguments."""
    mask = np.uint64((1 << width) - 1)
    a, b = values[0], values[-1]
    if op in COMPARED:
        return COMPARED[op](a, b, widths[0]).astype(np.uint64)
    with np.errstate(over="ignore"):
        match op:
            case "add":
                return (a + b) & mask
            case "sub":
                return (a - b) & mask
            case "mul":
                return (a * b) & mask
            case "not":
                return ~a & mask
            case "and":
                return a & b
            case "or":
                return a | b
            case "xor":
                return a ^ b
            case "shl":
                left: Words = np.where(b < width, a << np.minimum(b, np.uint64(63)), np.uint64(0))
                return left & mask
            case "lshr":
                right: Words = np.where(b < width, a >> np.minimum(b, np.uint64(63)), np.uint64(0))
                return right
            case "ashr":
                count = np.minimum(b, np.uint64(width - 1)).astype(np.int64)
                shifted: Words = (signed(a, width) >> count).view(np.uint64)
                return shifted & mask
            case "ite":
                chosen: Words = np.where(a != 0, values[1], values[2])
                return chosen
            case "concat":
                return (a << np.uint64(widths[1])) | b
            case "extract":
                return (a >> np.uint64(data)) & mask
            case "zext":
                return a
            case "sext":
                extended: Words = signed(a, widths[0]).view(np.uint64)
                return extended & mask
    raise AssertionError(op)


def signed(words: Words, width: int) -> NDArray[np.int64]:
    """Return words in two's complement as numbers."""
    sign = np.uint64(1 << (width - 1))
    with np.errstate(over="ignore"):
        return ((words ^ sign) - sign).view(np.int64)


COMPARED: dict[str, Callable[[Words, Words, int], NDArray[np.bool_]]] = {
    "eq": lambda a, b, width: a == b,
    "ult": lambda a, b, width: a < b,
    "ule": lambda a, b, width: a <= b,
    "slt": lambda a, b, width: signed(a, width) < signed(b, width),
    "sle": lambda a, b, width: signed(a, width) <= signed(b, width),
}


def reached(roots: Iterable[BitTerm]) -> list[BitTerm]:
    """Return the roots and all they are made of, arguments first."""
    found: dict[int, BitTerm] = {}
    left = list(roots)
    while left:
        term = left.pop()
        if term.number not in found:
            found[term.number] = term
            left.extend(term.args)
    return [found[number] for number in sorted(found)]


def evaluated(terms: Iterable[BitTerm], samples: Mapping[str, Words]) -> dict[BitTerm, Words]:
    """Return every value of terms that stand in the order of `reached`; a variable without samples is 0."""
    values: dict[BitTerm, Words] = {}
    count = len(next(iter(samples.values())))
    for term in terms:
        if term.op == "const":
            values[term] = np.full(count, term.data, np.uint64)
        elif term.op == "var":
            values[term] = samples.get(str(term.data), np.zeros(count, np.uint64))
        else:
            data = int(term.data) if term.op == "extract" else 0
            args = [values[arg] for arg in term.args]
            values[term] = applied(term.op, term.width, args, [arg.width for arg in term.args], data)
    return values


def signed_value(term: BitTerm) -> int:
    """Return a constant with its sign."""
    return with_sign(int(term.data), term.width)


def with_sign(number: int, width: int) -> int:
    """Return a number modulo two to the width as the one with a sign that a word holds."""
    number %= 1 << width
    return number - (1 << width) if number >> (width - 1) else number

"""Bit-vector terms, each of which is there once: what they are, how they simplify, and what they are for given values.

Two values that are written in the same way are the same term, which is most of a comparison. Words have 64 bits at
most.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import reduce

import numpy as np

from firmloop.verify.proofs.machine.normal import (
    HALF,
    LONG,
    bit_of,
    concatenated,
    ends_of,
    extended,
    is_sum,
    plus,
    shifted,
    signed_by,
    sum_of,
    truncated,
    upper,
    written,
)
from firmloop.verify.proofs.machine.values import COMPARED, BitTerm, applied, signed_value

COMMUTE = frozenset({"add", "mul", "and", "or", "xor", "eq"})


class Pool:
    """Makes terms, and keeps each."""

    def __init__(self) -> None:
        self._known: dict[tuple[object, ...], BitTerm] = {}
        self.ranges: dict[str, tuple[int, int]] = {}  # of variables, with a sign, both ends included; all else is any
        self.ends: dict[BitTerm, tuple[int, int]] = {}  # of terms, as far as they are known

    def const(self, value: int, width: int) -> BitTerm:
        """Return a constant, of which the low bits count."""
        return self._keep("const", width, (), value & ((1 << width) - 1))

    def var(self, name: str, width: int) -> BitTerm:
        """Return the variable of this name."""
        return self._keep("var", width, (), name)

    def make(self, op: str, *args: BitTerm) -> BitTerm:
        """Return `op` of terms of one width; of a comparison, one bit."""
        width = 1 if op in COMPARED else args[0].width
        if op in ("ule", "sle"):
            return self.make("not", self.make("ult" if op == "ule" else "slt", args[1], args[0]))
        if op in ("ult", "slt") and args[0].op == "const" != args[1].op:
            return self._turned(op, *args)
        if width == 1 and op in ("and", "or", "not"):
            return self._logic(op, args)
        if op in COMMUTE and (args[0].op == "const", args[0].number) > (args[1].op == "const", args[1].number):
            args = (args[1], args[0])  # the constant is last
        found = self._folded(op, width, args, 0) or self._shorter(op, args) or self._sum(op, args)
        if found is None and op in ("slt", "eq"):
            found = self._by_range(op, *args)
        return found or self.kept(op, *args)

    def _logic(self, op: str, args: tuple[BitTerm, ...]) -> BitTerm:
        """Return a truth value as choices by comparisons, in the order of these: one term for each function of them."""
        a, b = args[0], args[-1]
        fixed = next((one for one in args if one.op == "const"), None)
        if op == "not":
            if fixed is not None:
                return self.const(not a.value, 1)
            if a.op == "not":
                return a.args[0]
            if a.op != "ite":
                return self.kept("not", a)
        elif fixed is not None:
            return (b if fixed is a else a) if bool(fixed.value) == (op == "and") else fixed
        elif a is b:
            return a
        first = min((_decided_by(one) for one in args), key=lambda one: one.number)
        ways = [self._logic(op, tuple(self._decided(one, first, holds) for one in args)) for holds in (True, False)]
        return self.ite(first, *ways)

    def _decided(self, bit: BitTerm, condition: BitTerm, holds: bool) -> BitTerm:
        """Return a truth value where the comparison that decides it first holds, or does not."""
        if bit is condition or (bit.op == "not" and bit.args[0] is condition):
            return self.const(holds == (bit is condition), 1)
        return bit.args[1 if holds else 2] if bit.op == "ite" and bit.args[0] is condition else bit

    def kept(self, op: str, *args: BitTerm) -> BitTerm:
        """Return `op` of terms as it is."""
        return self._keep(op, 1 if op in COMPARED else args[0].width, args, 0)

    def scaled(self, term: BitTerm, factor: int) -> BitTerm:
        """Return a multiple of a term; of a power of two it is a shift."""
        if factor & (factor - 1):
            return self.kept("mul", term, self.const(factor, term.width))
        return term if factor == 1 else self.kept("shl", term, self.const(factor.bit_length() - 1, term.width))

    def _sum(self, op: str, args: tuple[BitTerm, ...]) -> BitTerm | None:
        """Return a sum as `normal` writes it; None of anything else."""
        a, b = args[0], args[-1]
        if op in ("add", "sub"):
            return written(self, plus(sum_of(a), sum_of(b), 1 if op == "add" else -1), a.width)
        if b.value is None or (op == "shl" and b.value >= a.width) or op not in ("mul", "shl"):
            return None
        return written(self, plus(({}, 0), sum_of(a), b.value if op == "mul" else 1 << b.value), a.width)

    def _by_range(self, op: str, a: BitTerm, b: BitTerm) -> BitTerm | None:
        """Return a comparison that the ranges of both sides decide."""
        (low, high), (least, most) = ends_of(self, a), ends_of(self, b)
        apart = high < least or low > most or (op == "slt" and low == most)
        return self.const(op == "slt" and high < least, 1) if apart else None

    def _turned(self, op: str, constant: BitTerm, term: BitTerm) -> BitTerm:
        """Return whether a constant is less, with the constant on the right."""
        last = (1 << (term.width - (op == "slt"))) - 1
        if constant.value == last:
            return self.const(0, 1)
        return self.make("not", self.make(op, term, self.const(int(constant.data) + 1, term.width)))

    def ite(self, condition: BitTerm, yes: BitTerm, no: BitTerm) -> BitTerm:
        """Return `yes` where the condition holds, else `no`."""
        if condition.value is not None:
            return yes if condition.value else no
        if yes is no:
            return yes
        if condition.op == "not":
            return self.ite(condition.args[0], no, yes)
        if condition.op == "ite":
            first, *ways = condition.args
            return self.ite(first, *(self.ite(way, yes, no) for way in ways))
        if condition.op == "eq" and condition.args[0] is yes and condition.args[1].op == "const":
            return self.ite(condition, condition.args[1], no)
        if yes.width > 1 and {yes.value, no.value} == {0, 1}:
            return self.extend("zext", condition if yes.value else self.make("not", condition), yes.width)
        if yes.op == "ite" and yes.args[0] is condition:
            return self.ite(condition, yes.args[1], no)
        if no.op == "ite" and no.args[0] is condition:
            return self.ite(condition, yes, no.args[2])
        limit = next((one for one in (yes, no) if one.op == "const"), None)
        if limit is not None and condition.op == "slt" and condition.args[1].value is not None:
            # At the limit itself both are the same.
            term = no if limit is yes else yes
            above = self.const(int(limit.data) + 1, limit.width)
            if condition.args[0] is term and condition.args[1] is above and signed_value(above) > signed_value(limit):
                return self.ite(self.make("slt", term, limit), yes, no)
        if yes.width == 1 and yes.value is not None and no.value is not None:
            return condition if yes.value else self.make("not", condition)
        return self._extended(condition, yes, no) or self._keep("ite", yes.width, (condition, yes, no), 0)

    def _extended(self, condition: BitTerm, yes: BitTerm, no: BitTerm) -> BitTerm | None:
        """Return a choice between extended words as the extension of a choice, so that it is there as a short word."""
        op, width = next(((one.op, one.args[0].width) for one in (yes, no) if one.op in ("zext", "sext")), ("", 0))
        short = [self.extract(one, 0, width) for one in (yes, no) if one.op in (op, "const")]
        if (
            not op
            or len(short) < 2
            or any(self.extend(op, a, yes.width) is not b for a, b in zip(short, (yes, no), strict=True))
        ):
            return None
        return self.extend(op, self.ite(condition, *short), yes.width)

    def extract(self, term: BitTerm, low: int, width: int) -> BitTerm:
        """Return `width` bits of a term, from bit `low` on."""
        if width == term.width:
            return term
        inner = term.args[-1] if term.args else term
        if term.op == "extract":
            return self.extract(inner, low + int(term.data), width)
        if term.op == "concat":
            if low + width <= inner.width:
                return self.extract(inner, low, width)
            if low >= inner.width:
                return self.extract(term.args[0], low - inner.width, width)
        if term.op in ("zext", "sext"):
            if low + width <= inner.width:
                return self.extract(inner, low, width)
            if low >= inner.width and term.op == "zext":
                return self.const(0, width)
            if low == 0:
                return self.extend(term.op, inner, width)
        if term.op == "ite" and all(arg.op in ("const", "concat", "zext") for arg in term.args[1:]):
            return self.ite(term.args[0], *(self.extract(arg, low, width) for arg in term.args[1:]))
        if term.op in ("and", "or", "xor", "not"):
            return self.make(term.op, *(self.extract(arg, low, width) for arg in term.args))
        return self._of_long(term, low, width) or self.sliced(term, low, width)

    def _of_long(self, term: BitTerm, low: int, width: int) -> BitTerm | None:
        """Return bits of a sum or of a shifted or extended word as what they are of shorter words."""
        inner, top = term.args[0] if term.args else term, low + width
        if is_sum(term) and top <= HALF < term.width:
            return self.extract(truncated(self, term, HALF), low, width)
        if is_sum(term) and top == 1:
            odd = [one for one, count in sum_of(term)[0].items() if count % 2]
            if len(odd) == 1 and not sum_of(term)[1] % 2:
                return self.extract(odd[0], 0, 1)
        if is_sum(term) and low and width == 1 and (bit := bit_of(self, term, low)) is not None:
            return bit
        if term.op == "mul" and top <= HALF < term.width:
            halves = [self.extract(arg, 0, HALF) for arg in term.args]
            return self.extract(self.make("mul", *halves), low, width)
        if term.op in ("ashr", "lshr") and term.args[1].value is not None:
            count = term.args[1].value
            if top + count <= term.width:
                return self.extract(inner, low + count, width)
            if term.op == "ashr" and term.width == LONG and low == 0 and width == HALF <= count < LONG:
                return self.make("ashr", self.extract(inner, HALF, HALF), self.const(count - HALF, HALF))
        if term.width != LONG or width != HALF or not low:
            return None
        if low == HALF:
            return upper(self, term) if is_sum(term) else None
        if low < HALF:
            if term.op == "sext" and inner.width == HALF:
                return self.make("ashr", inner, self.const(low, HALF))
            return self.extract(self.make("shl", term, self.const(HALF - low, LONG)), HALF, HALF)
        return None

    def sliced(self, term: BitTerm, low: int, width: int) -> BitTerm:
        """Return `width` bits of a term, as a slice of it."""
        return self._folded("extract", width, (term,), low) or self._keep("extract", width, (term,), low)

    def concat(self, high: BitTerm, low: BitTerm) -> BitTerm:
        """Return the bits of both, `high` above `low`."""
        width = high.width + low.width
        if high.op == low.op == "extract" and high.args == low.args and high.data == int(low.data) + low.width:
            return self.extract(low.args[0], int(low.data), width)
        if low.op == "concat" and high.op == "extract" and low.args[0].op == "extract":
            upper = self.concat(high, low.args[0])
            if upper.op != "concat":
                return self.concat(upper, low.args[1])
        if high.value == 0:
            return self.extend("zext", low, width)
        if width == LONG and low.width == HALF and (word := concatenated(self, high, low)) is not None:
            return word
        if low.value is not None and high.value is None and width == LONG:
            above = self.make("shl", self.extend("zext", high, width), self.const(low.width, width))
            return self.make("add", above, self.const(low.value, width))
        if high.op == low.op == "ite" and high.args[0] is low.args[0]:
            pairs = zip(high.args[1:], low.args[1:], strict=True)
            return self.ite(high.args[0], *(self.concat(a, b) for a, b in pairs))
        return self._folded("concat", width, (high, low), 0) or self._keep("concat", width, (high, low), 0)

    def extend(self, op: str, term: BitTerm, width: int) -> BitTerm:
        """Return a term with zeros above it (`zext`) or its sign (`sext`)."""
        if term.width == width:
            return term
        if term.op == op:
            return self.extend(op, term.args[0], width)
        if term.op == "extract" and term.data == 0 and (inner := term.args[0]).width <= width:
            low, high = (end / (1 << (term.width - 1)) for end in ends_of(self, inner))
            if (-1 <= low and high < 1) if op == "sext" else (low >= 0 and high < 2):
                return self.extend(op, inner, width)
        if op == "sext" and term.op == "zext":
            return self.extend("zext", term.args[0], width)
        if op == "sext" and is_sum(term) and (apart := extended(self, term, width)) is not None:
            return apart
        return self._folded(op, width, (term,), 0) or self._keep(op, width, (term,), 0)

    def all_of(self, terms: Iterable[BitTerm]) -> BitTerm:
        """Return one bit that is set where all are."""
        return reduce(lambda a, b: self.make("and", a, b), terms, self.const(1, 1))

    def rebuilt(self, term: BitTerm, args: Sequence[BitTerm]) -> BitTerm:
        """Return the same of other arguments."""
        if tuple(args) == term.args:
            return term
        match term.op:
            case "ite":
                return self.ite(*args)
            case "extract":
                return self.extract(args[0], int(term.data), term.width)
            case "concat":
                return self.concat(*args)
            case "zext" | "sext":
                return self.extend(term.op, args[0], term.width)
            case _:
                return self.make(term.op, *args)

    def _keep(self, op: str, width: int, args: tuple[BitTerm, ...], data: int | str) -> BitTerm:
        key = (op, width, *(arg.number for arg in args), data)
        found = self._known.get(key)
        if found is None:
            found = self._known[key] = BitTerm(op, width, args, data, len(self._known))
        return found

    def _folded(self, op: str, width: int, args: tuple[BitTerm, ...], data: int) -> BitTerm | None:
        if any(arg.op != "const" for arg in args):
            return None
        values = [np.array([arg.value], np.uint64) for arg in args]
        return self.const(int(applied(op, width, values, [arg.width for arg in args], data)[0]), width)

    def _shorter(self, op: str, args: tuple[BitTerm, ...]) -> BitTerm | None:
        """Return an equal term that is there without `op`; None where no rule says so."""
        a, b = args[0], args[-1]
        match op:
            case "not" if a.op == "not":
                return a.args[0]
            case "sub" | "xor" if a is b:
                return self.const(0, a.width)
            case "and" | "or" if a is b:
                return a
            case "and" if b.value == 0:
                return b
            case "add" | "sub" | "or" | "xor" | "shl" | "lshr" | "ashr" if b.value == 0:
                return a
            case "eq" if a is b:
                return self.const(1, 1)
            case "eq" if b.value is not None:
                return self._compared(a, b)
            case "ult" | "slt" if a is b:
                return self.const(0, 1)
            case _:
                return self._as_slice(op, a, b)

    def _as_slice(self, op: str, a: BitTerm, b: BitTerm) -> BitTerm | None:
        """Return what a shift or a mask is as a slice, a sum or a choice; None where no rule says so."""
        match op:
            case "lshr" if b.value is not None and b.value < a.width:
                return self.extend("zext", self.extract(a, b.value, a.width - b.value), a.width)
            case "ashr" if b.value is not None and a.width == HALF and b.value >= HALF - 1:
                return self.extract(self.extend("sext", a, LONG), HALF, HALF)
            case "ashr" if b.value is not None and is_sum(a) and (whole := shifted(self, a, b.value)) is not None:
                return whole
            case "ashr" if a.op == "shl" and a.args[1] is b and b.value is not None and b.value < a.width:
                return self.extend("sext", self.extract(a.args[0], 0, a.width - b.value), a.width)
            case "or" if a.op == "zext" or b.op == "zext":
                return self._side_by_side(a, b) or self._side_by_side(b, a)
            case "and" | "xor" if a.width == HALF and (chosen := self._by_sign(op, a, b) or self._by_sign(op, b, a)):
                return chosen
            case "xor" if b.value == 1 and a.op == "zext" and a.args[0].width == 1:
                return self.extend("zext", self.make("not", a.args[0]), a.width)
            case "and" if b.value is not None and not b.value & (b.value + 1) and b.value:
                return self.extend("zext", self.extract(a, 0, b.value.bit_length()), a.width)
            case _:
                return None

    def _by_sign(self, op: str, word: BitTerm, sign: BitTerm) -> BitTerm | None:
        """Return a word masked or inverted by the sign of another as a choice."""
        inverted = sign.op == "not"
        signed = signed_by(self, sign.args[0] if inverted else sign)
        if signed is None or (inverted and op == "xor"):
            return None
        negative = self.make("slt", signed, self.const(0, HALF))
        if op == "xor":
            return self.ite(negative, self.make("sub", self.const(-1, HALF), word), word)
        ways = (word, self.const(0, HALF))
        return self.ite(negative, *(reversed(ways) if inverted else ways))

    def _side_by_side(self, high: BitTerm, low: BitTerm) -> BitTerm | None:
        """Return words that have no bit in common as a sum, or as a slice of the longer word that they are of."""
        total, constant = sum_of(high)
        if low.op != "zext":
            return None
        part = low.args[0]
        place = part.width
        if any(factor % (1 << place) for factor in (constant, *total.values())):
            return None
        if part.op == "extract" and high.width == HALF == part.args[0].width == int(part.data) + place:
            above = {term: factor >> place for term, factor in total.items()}, constant >> place
            return self.extract(self.concat(written(self, above, HALF), part.args[0]), HALF - place, HALF)
        return self.make("add", high, low)

    def _compared(self, a: BitTerm, b: BitTerm) -> BitTerm | None:
        """Return whether a choice between constants, or a longer word, is a constant."""
        if a.width == 1:
            return a if b.value else self.make("not", a)
        if a.op == "ite" and all(arg.op == "const" for arg in a.args[1:]):
            return self.ite(a.args[0], *(self.const(int(arg.value == b.value), 1) for arg in a.args[1:]))
        if a.op == "zext":
            inner = a.args[0]
            value = int(b.value or 0)
            return (
                self.make("eq", inner, self.const(value, inner.width)) if not value >> inner.width else self.const(0, 1)
            )
        return None


def _decided_by(bit: BitTerm) -> BitTerm:
    """Return the comparison that decides a truth value first."""
    return bit.args[0] if bit.op in ("ite", "not") else bit

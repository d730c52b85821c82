"""Write sums, and words in two halves, in one way: what a compiler makes of a sum of products is then the same term.

A sum is coefficients of terms, so that shifts and additions that stand for a product by a constant are that product.
Where a word of 32 bits is the upper half of a longer one, with the carry or the borrow of the lower half, or with its
highest bit added to round, it is the upper half of a sum of 64 bits; a slice of a longer word is the upper half of a
multiple of it. Each rule is an identity for all values.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from firmloop.verify.proofs.machine.terms import BitTerm, Pool

HALF, LONG = 32, 64
Coefficients = dict["BitTerm", int]  # what each term is multiplied by, modulo two to the width
Sum = tuple[Coefficients, int]  # and a constant


def is_sum(term: BitTerm) -> bool:
    """Tell whether a term is one by its operation."""
    return term.op in ("add", "sub") or (term.op in ("mul", "shl") and term.args[1].op == "const")


def sum_of(term: BitTerm) -> Sum:
    """Return a term as a sum; one that is none is itself, once."""
    if term.op == "const":
        return {}, int(term.data)
    if not is_sum(term):
        return {term: 1}, 0
    a, b = term.args
    if term.op in ("add", "sub"):
        return plus(sum_of(a), sum_of(b), 1 if term.op == "add" else -1)
    factor = int(b.data)
    return plus(({}, 0), sum_of(a), factor if term.op == "mul" else 1 << factor)


def plus(one: Sum, other: Sum, factor: int) -> Sum:
    """Return `one` and `factor` times `other`."""
    found = dict(one[0])
    for term, count in other[0].items():
        found[term] = found.get(term, 0) + factor * count
    return found, one[1] + factor * other[1]


def written(pool: Pool, total: Sum, width: int) -> BitTerm:
    """Return the term of a sum: what is added in the order of making, the constant, then what is taken away."""
    signs = {term: _signed(count, width) for term, count in total[0].items() if count % (1 << width)}
    joined = _joined(pool, (signs, total[1])) if width == HALF else None
    if joined is not None:
        return written(pool, joined, width)
    made = pool.const(total[1], width)
    added = [pool.scaled(t, signs[t]) for t in sorted(signs, key=lambda t: t.number) if signs[t] > 0]
    for term in [*added[1:], *([made] if made.value and added else [])]:
        added[0] = pool.kept("add", added[0], term)
    made = added[0] if added else made
    for term in sorted((t for t in signs if signs[t] < 0), key=lambda t: t.number):
        made = pool.kept("sub", made, pool.scaled(term, -signs[term]))
    return made


def truncated(pool: Pool, term: BitTerm, width: int) -> BitTerm:
    """Return the lowest bits of a sum."""
    coefficients, constant = sum_of(term)
    parts: Sum = {}, constant
    for one, count in coefficients.items():
        parts = plus(parts, sum_of(pool.extract(one, 0, width)), count)
    return written(pool, parts, width)


def upper(pool: Pool, term: BitTerm) -> BitTerm:
    """Return the upper half of a word of 64 bits, outside of which stands what is in that half alone."""
    coefficients, constant = sum_of(term)
    half = 1 << HALF
    outside: Sum = {}, constant >> HALF
    for one, count in coefficients.items():
        if count % half == 0:
            outside = plus(outside, sum_of(pool.extract(one, 0, HALF)), count >> HALF)
    inside = {one: count for one, count in coefficients.items() if count % half}
    if len(inside) == 1 and not constant % half:
        ((one, count),) = inside.items()
        if 0 < _signed(count, LONG) * _reach(one) <= half // 2:
            inside = {one: 1}  # of a word that fits in its lower half, the upper half is its sign
    whole = written(pool, (inside, constant % half), LONG)
    if inside:
        outside = plus(outside, ({pool.sliced(whole, HALF, HALF): 1}, 0), 1)
    return written(pool, outside, HALF)


def extended(pool: Pool, term: BitTerm, width: int) -> BitTerm | None:
    """Return a sum with its sign above it as a sum of words with their signs, where none of them can overflow."""
    coefficients, constant = sum_of(term)
    reach = abs(_signed(constant, term.width))
    parts: Sum = {}, _signed(constant, term.width)
    for one, count in coefficients.items():
        reach += abs(_signed(count, term.width)) * _reach(one)
        parts = plus(parts, sum_of(pool.extend("sext", one, width)), _signed(count, term.width))
    return written(pool, parts, width) if reach < 1 << (term.width - 1) else None


def paired(pool: Pool, high: BitTerm, low: BitTerm) -> BitTerm | None:
    """Return the word of 64 bits that has these halves; None where no such word is there."""
    if high.op == "extract" and high.args[0].width == LONG and high.data == HALF:
        if pool.extract(high.args[0], 0, HALF) is low:
            return high.args[0]
        word = pool.extend("sext", low, LONG)
        if pool.extract(word, HALF, HALF) is high:
            return word
    return None


def concatenated(pool: Pool, high: BitTerm, low: BitTerm) -> BitTerm | None:
    """Return the word of 64 bits that has these halves, where a term of the upper one belongs to the lower one."""
    coefficients, constant = sum_of(high)
    for one, count in coefficients.items():
        word = paired(pool, one, low) if count == 1 else None
        if word is not None:
            rest = {term: number for term, number in coefficients.items() if term is not one}
            above = pool.extend("zext", written(pool, (rest, constant), HALF), LONG)
            return pool.make("add", word, pool.make("shl", above, pool.const(HALF, LONG)))
    return None


def _joined(pool: Pool, total: Sum) -> Sum | None:
    """Return the same sum with an upper half and what belongs to it as the upper half of a sum."""
    for term, count in total[0].items():
        if term.op != "zext" or term.args[0].width != 1:
            continue
        bit = term.args[0]
        if bit.op == "not":
            return plus(plus(total, ({term: count}, 0), -1), ({pool.extend("zext", bit.args[0], HALF): 1}, -1), -count)
        rest = plus(total, ({term: count}, 0), -1)
        found = None
        if bit.op == "extract" and count == 1:
            found = _rounded(pool, rest, bit)
        elif bit.op == "ult" and count == 1:
            x, y = bit.args
            found = _carried(pool, rest, (y, pool.make("sub", x, y)), 1)
        elif bit.op == "ult" and count == -1:
            found = _carried(pool, rest, bit.args, -1)
        elif bit.op == "eq" and bit.args[1].value == 0 and count == 1 and bit.args[0].width == HALF:
            found = _carried(pool, plus(rest, ({}, 1), 1), (pool.const(0, HALF), bit.args[0]), -1)
        if found is not None:
            return found
    return None


def _rounded(pool: Pool, rest: Sum, bit: BitTerm) -> Sum | None:
    for one, count in rest[0].items():
        if count == 1 and one.op == "extract" and one.args[0].width == LONG and one.data == HALF:
            word = one.args[0]
            if pool.extract(word, HALF - 1, 1) is bit:
                more = pool.make("add", word, pool.const(1 << (HALF - 1), LONG))
                return plus(plus(rest, ({one: 1}, 0), -1), sum_of(pool.extract(more, HALF, HALF)), 1)
    return None


def _carried(pool: Pool, rest: Sum, lows: tuple[BitTerm, ...], sign: int) -> Sum | None:
    """Return the sum of upper halves and the carry of the lower ones; `sign` -1: a difference and its borrow."""
    words: list[BitTerm] = []
    before, known = rest, 0
    for low, factor in zip(lows, (1, sign), strict=True):
        for one, count in before[0].items():
            word = paired(pool, one, low) if count == factor else None
            if word is not None:
                words.append(word)
                before, known = plus(before, ({one: 1}, 0), -factor), known + 1
                break
        else:
            words.append(pool.extend("zext", low, LONG))
    if not known:
        return None
    both = pool.make("add" if sign == 1 else "sub", *words)
    return plus(before, sum_of(pool.extract(both, HALF, HALF)), 1)


def _signed(count: int, width: int) -> int:
    count %= 1 << width
    return count - (1 << width) if count >> (width - 1) else count


def _reach(term: BitTerm) -> int:
    """Return a number that a word with a sign is never further than from 0."""
    if term.op == "sext":
        return 1 << (term.args[0].width - 1)
    return 1 << (term.args[0].width if term.op == "zext" else term.width - 1)

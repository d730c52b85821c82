"""Write sums, and words in two halves, in one way: what a compiler makes of a sum of products is then the same term.

A sum is coefficients of terms, so that shifts and additions that stand for a product by a constant are that product.
Where a word of 32 bits is the upper half of a longer one, with the carry or the borrow of the lower half, or with its
highest bit added to round, it is the upper half of a sum of 64 bits; a slice of a longer word is the upper half of a
multiple of it. Each rule is an identity for all values.
"""

from __future__ import annotations

from math import gcd
from typing import Protocol

from firmloop.verify.proofs.machine.values import BitTerm, signed_value, with_sign

HALF, LONG = 32, 64
Coefficients = dict[BitTerm, int]  # what each term is multiplied by, modulo two to the width
Sum = tuple[Coefficients, int]  # and a constant


class Maker(Protocol):
    """What makes terms, and keeps what is known of their ranges."""

    ranges: dict[str, tuple[int, int]]
    ends: dict[BitTerm, tuple[int, int]]

    def const(self, value: int, width: int) -> BitTerm: ...  # noqa: D102
    def make(self, op: str, *args: BitTerm) -> BitTerm: ...  # noqa: D102
    def kept(self, op: str, *args: BitTerm) -> BitTerm: ...  # noqa: D102
    def scaled(self, term: BitTerm, factor: int) -> BitTerm: ...  # noqa: D102
    def extract(self, term: BitTerm, low: int, width: int) -> BitTerm: ...  # noqa: D102
    def sliced(self, term: BitTerm, low: int, width: int) -> BitTerm: ...  # noqa: D102
    def extend(self, op: str, term: BitTerm, width: int) -> BitTerm: ...  # noqa: D102


def is_sum(term: BitTerm) -> bool:
    """Tell whether a term is one by its operation."""
    if term.op in ("add", "sub"):
        return True
    factor = term.args[1].value if term.op in ("mul", "shl") else None
    return factor is not None and (term.op == "mul" or factor < term.width)


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


def written(pool: Maker, total: Sum, width: int) -> BitTerm:
    """Return the term of a sum: what is added in the order of making, the constant, then what is taken away."""
    signs = {term: with_sign(count, width) for term, count in total[0].items() if count % (1 << width)}
    for sign in (1, -1) if width == HALF else ():
        joined = _joined(pool, plus(({}, 0), (signs, total[1]), sign))
        if joined is not None:
            return written(pool, plus(({}, 0), joined, sign), width)
    made = pool.const(total[1], width)
    added = [pool.scaled(t, signs[t]) for t in sorted(signs, key=lambda t: t.number) if signs[t] > 0]
    for term in [*added[1:], *([made] if made.value and added else [])]:
        added[0] = pool.kept("add", added[0], term)
    made = added[0] if added else made
    for term in sorted((t for t in signs if signs[t] < 0), key=lambda t: t.number):
        made = pool.kept("sub", made, pool.scaled(term, -signs[term]))
    return made


def truncated(pool: Maker, term: BitTerm, width: int) -> BitTerm:
    """Return the lowest bits of a sum."""
    coefficients, constant = sum_of(term)
    parts: Sum = {}, constant
    for one, count in coefficients.items():
        parts = plus(parts, sum_of(pool.extract(one, 0, width)), count)
    return written(pool, parts, width)


def bit_of(pool: Maker, term: BitTerm, place: int) -> BitTerm | None:
    """Return a bit of a sum as a bit of the sum without the lowest bits, which are 0; None where they are not."""
    coefficients, constant = sum_of(term)
    count = place
    for number in (constant, *coefficients.values()):
        count = min(count, (number & -number).bit_length() - 1) if number else count
    if not count:
        return None
    less = {one: number >> count for one, number in coefficients.items()}, constant >> count
    return pool.extract(written(pool, less, term.width), place - count, 1)


def upper(pool: Maker, term: BitTerm) -> BitTerm:
    """Return the upper half of a word of 64 bits, outside of which stands what is in that half alone."""
    coefficients, constant = sum_of(term)
    half = 1 << HALF
    outside: Sum = {}, constant >> HALF
    inside: Coefficients = {}
    for one, count in coefficients.items():
        below = with_sign(count, HALF)
        outside = plus(outside, sum_of(pool.extract(one, 0, HALF)), (count - below) >> HALF)
        inside |= {one: below} if below else {}
    common = gcd(*inside.values(), constant % half)
    if common > 1 and _fits(pool, (inside, constant % half), HALF):
        # Of a word that fits in its lower half, the upper half is its sign.
        inside, constant = {one: count // common for one, count in inside.items()}, constant % half // common
    whole = written(pool, (inside, constant % half), LONG)
    if inside:
        outside = plus(outside, ({pool.sliced(whole, HALF, HALF): 1}, 0), 1)
    return written(pool, outside, HALF)


def extended(pool: Maker, term: BitTerm, width: int) -> BitTerm | None:
    """Return a sum with its sign above it as a sum of words with their signs, where none of them can overflow."""
    total = with_signs(term)
    if not _fits(pool, total, term.width):
        return None
    parts: Sum = {}, total[1]
    for one, count in total[0].items():
        parts = plus(parts, sum_of(pool.extend("sext", one, width)), count)
    return written(pool, parts, width)


def shifted(pool: Maker, term: BitTerm, count: int) -> BitTerm | None:
    """Return a sum without its lowest bits, where all of them are 0 and it cannot overflow."""
    coefficients, constant = with_signs(term)
    if any(number % (1 << count) for number in (constant, *coefficients.values())):
        return None
    fits = _fits(pool, (coefficients, constant), term.width)
    parts = {one: number >> count for one, number in coefficients.items()}, constant >> count
    return written(pool, parts, term.width) if fits else None


def paired(pool: Maker, high: BitTerm, low: BitTerm) -> BitTerm | None:
    """Return the word of 64 bits that has these halves; None where no such word is there."""
    if is_upper(high):
        if pool.extract(high.args[0], 0, HALF) is low:
            return high.args[0]
        word = pool.extend("sext", low, LONG)
        if pool.extract(word, HALF, HALF) is high:
            return word
    if high.op == "ashr" and high.args[1].value is not None:
        long = pool.extend("sext", high.args[0], LONG)
        word = pool.make("shl", long, pool.const(HALF - high.args[1].value, LONG))
        if pool.extract(word, 0, HALF) is low:
            return word
    return None


def concatenated(pool: Maker, high: BitTerm, low: BitTerm) -> BitTerm | None:
    """Return the word of 64 bits that has these halves, where a term of the upper one belongs to the lower one."""
    coefficients, constant = sum_of(high)
    for one, count in coefficients.items():
        word = paired(pool, one, low) if with_sign(count, HALF) > 0 else None
        if word is not None:
            rest = plus((coefficients, constant), ({one: 1}, 0), -1)
            above = pool.extend("zext", written(pool, rest, HALF), LONG)
            return pool.make("add", word, pool.make("shl", above, pool.const(HALF, LONG)))
    return None


def _joined(pool: Maker, total: Sum) -> Sum | None:
    """Return the same sum with an upper half and what belongs to it as the upper half of a sum."""
    for term, count in total[0].items():
        if count > 0 and is_upper(term) and (more := _met(pool, total, term)) is not None:
            return more
        if count > 0 and is_upper(term) and (more := _multiplied(pool, total, term)) is not None:
            return more
        if term.op != "zext" or term.args[0].width != 1:
            continue
        bit = term.args[0]
        rest = plus(total, ({term: count}, 0), -1)
        if bit.op == "not":
            return plus(rest, ({pool.extend("zext", bit.args[0], HALF): 1}, -1), -count)
        found = None
        if bit.op == "extract" and count == 1:
            found = _rounded(pool, rest, bit)
        elif bit.op == "ult" and count > 0:
            x, y = bit.args
            found = _carried(pool, rest, (y, pool.make("sub", x, y)), 1, count)
        elif bit.op == "ult":
            found = _carried(pool, rest, bit.args, -1, -count)
        elif bit.op == "eq" and bit.args[1].value == 0 and count > 0 and bit.args[0].width == HALF:
            rest = plus(rest, ({}, 1), count)
            found = _carried(pool, rest, (pool.const(0, HALF), bit.args[0]), -1, count)
        if found is not None:
            return found
    return None


def is_upper(term: BitTerm) -> bool:
    """Tell whether a term is the upper half of a word of 64 bits."""
    return term.op == "extract" and term.args[0].width == LONG and term.data == HALF and term.width == HALF


def signed_by(pool: Maker, term: BitTerm) -> BitTerm | None:
    """Return the word whose sign a term is, in every bit; None where it is none."""
    fits = is_upper(term) and _fits(pool, with_signs(term.args[0]), HALF)
    return pool.extract(term.args[0], 0, HALF) if fits else None


def _alone(term: BitTerm, count: int) -> bool:
    """Tell whether a part of a long sum is a lower half whose upper one stands elsewhere."""
    return term.op == "zext" and term.args[0].width == HALF and count % (1 << HALF) != 0


def _met(pool: Maker, total: Sum, high: BitTerm) -> Sum | None:
    """Return a sum in which a lower half alone, whose carry is in `high`, has met the upper one that belongs to it."""
    for low, count in sum_of(high.args[0])[0].items():
        factor = with_sign(count, LONG)
        if not _alone(low, count):
            continue
        for other, number in total[0].items():
            times = min(total[0][high], number // factor)
            word = paired(pool, other, low.args[0]) if times > 0 and other is not high else None
            if word is not None and not any(_alone(one, many) for one, many in sum_of(word)[0].items()):
                whole = plus(plus(sum_of(high.args[0]), ({low: 1}, 0), -factor), sum_of(word), factor)
                rest = plus(plus(total, ({high: 1}, 0), -times), ({other: 1}, 0), -factor * times)
                return plus(rest, sum_of(pool.extract(written(pool, whole, LONG), HALF, HALF)), times)
    return None


def _multiplied(pool: Maker, total: Sum, high: BitTerm) -> Sum | None:
    """Return a sum with the product of two long words, where products of their halves stood."""
    product = high.args[0]
    if product.op != "mul" or any(arg.op != "zext" or arg.args[0].width != HALF for arg in product.args):
        return None
    a, b = (arg.args[0] for arg in product.args)
    crossed = [term for term, count in total[0].items() if term.op == "mul" and count > 0]
    for one in crossed:
        for other in crossed:
            for k, m in ((0, 0), (0, 1), (1, 0), (1, 1)):
                if one is other or one.args[1 - k] is not b or other.args[1 - m] is not a:
                    continue
                long_a, long_b = paired(pool, one.args[k], a), paired(pool, other.args[m], b)
                if long_a is not None and long_b is not None:
                    whole = pool.extract(pool.make("mul", long_a, long_b), HALF, HALF)
                    rest = plus(total, ({high: 1, one: 1, other: 1}, 0), -1)
                    return plus(rest, sum_of(whole), 1)
    return None


def _rounded(pool: Maker, rest: Sum, bit: BitTerm) -> Sum | None:
    for one, count in rest[0].items():
        if count > 0 and is_upper(one):
            word = one.args[0]
            if pool.extract(word, HALF - 1, 1) is bit:
                # Twice the upper half and the highest bit below it are the upper half of twice the word.
                more = pool.make("add", word, word if count > 1 else pool.const(1 << (HALF - 1), LONG))
                return plus(plus(rest, ({one: min(count, 2)}, 0), -1), sum_of(pool.extract(more, HALF, HALF)), 1)
    return None


def _carried(pool: Maker, rest: Sum, lows: tuple[BitTerm, ...], sign: int, times: int) -> Sum | None:
    """Return the sum of upper halves and the carry of the lower ones; `sign` -1: a difference and its borrow."""
    words: list[BitTerm] = []
    before, known = rest, 0
    for low, factor in zip(lows, (times, sign * times), strict=True):
        for one, count in before[0].items():
            word = paired(pool, one, low) if count * factor >= times**2 else None
            if word is not None:
                words.append(word)
                before, known = plus(before, ({one: 1}, 0), -factor), known + 1
                break
        else:
            words.append(pool.extend("zext", low, LONG))
    if not known:
        return None
    both = pool.make("add" if sign == 1 else "sub", *words)
    return plus(before, sum_of(pool.extract(both, HALF, HALF)), times)


def ends_of(pool: Maker, term: BitTerm) -> tuple[int, int]:
    """Return two values that a word with a sign is never below and never above."""
    if term not in pool.ends:
        half = 1 << (term.width - 1)
        low, high = _inner_ends(pool, term)
        pool.ends[term] = (low, high) if -half <= low and high < half else (-half, half - 1)
    return pool.ends[term]


def _inner_ends(pool: Maker, term: BitTerm) -> tuple[int, int]:
    half = 1 << (term.width - 1)
    if is_sum(term) or term.op == "const":
        return _sum_ends(pool, with_signs(term))
    match term.op:
        case "var":
            return pool.ranges.get(str(term.data), (-half, half - 1))
        case "zext":
            return 0, (1 << term.args[0].width) - 1
        case "sext":
            return ends_of(pool, term.args[0])
        case "ashr" if term.args[1].value is not None:
            low, high = ends_of(pool, term.args[0])
            return low >> term.args[1].value, high >> term.args[1].value
        case "extract" if is_upper(term):
            low, high = ends_of(pool, term.args[0])
            return low >> HALF, high >> HALF
        case "ite":
            (a, b), (c, d) = (_ends_where(pool, term.args[0], k == 1, term.args[k]) for k in (1, 2))
            return min(a, c), max(b, d)
        case _:
            return -half, half - 1


def _ends_where(pool: Maker, condition: BitTerm, holds: bool, term: BitTerm) -> tuple[int, int]:
    """Return the ends of a term where a condition holds, or does not, which may bound it."""
    low, high = ends_of(pool, term)
    if condition.op == "slt" and condition.args[0] is term and condition.args[1].op == "const":
        limit = signed_value(condition.args[1])
        low, high = (low, min(high, limit - 1)) if holds else (max(low, limit), high)
    return min(low, high), max(low, high)


def _sum_ends(pool: Maker, total: Sum) -> tuple[int, int]:
    """Return between what a sum is, of coefficients with their signs, if nothing overflows."""
    least = most = total[1]
    for term, count in total[0].items():
        low, high = ends_of(pool, term)
        least += count * (low if count > 0 else high)
        most += count * (high if count > 0 else low)
    return least, most


def _fits(pool: Maker, total: Sum, width: int) -> bool:
    """Tell whether a sum, of coefficients with their signs, never leaves a word of this width."""
    least, most = _sum_ends(pool, total)
    return -(1 << (width - 1)) <= least and most < 1 << (width - 1)


def with_signs(term: BitTerm) -> Sum:
    """Return a term as a sum of coefficients with their signs."""
    coefficients, constant = sum_of(term)
    return {one: with_sign(count, term.width) for one, count in coefficients.items()}, with_sign(constant, term.width)

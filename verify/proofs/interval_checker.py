"""Prove a fixed-point program's ranges from proof.json alone, by interval rules in exact whole numbers.

Nothing of the prover is used, and nothing of the z3 check: this file knows the C of each operation by itself: the word
of every operand, the shift counts for which C defines the shift, and every intermediate that must fit its type. Each
operation is monotone in each operand, or is taken apart where it is not; so the ends of the ranges give the exact range
of the result, without a search.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from firmloop.verify.proofs.claims import LEAST, OF_A_PLAN, Argument, ClaimedOperation, Claims, ProofError
from firmloop.verify.proofs.table_checker import check_sweeps, check_tree

Interval = tuple[int, int]
TABLES = {"sweeps": check_sweeps, "tree": check_tree}  # operations over a table
TRUTH = (0, 1)


@dataclass(frozen=True, slots=True)
class IntervalRule:
    """What an operation takes and gives.

    `operands`: a letter each: `v` a 32-bit value or constant, `w` a 64-bit value, `t` a truth value, `s` a shift count.
    """

    operands: str
    image: Callable[..., Interval]  # of the operands' intervals
    bits: int = 32  # of the result
    counts: Interval = (0, 0)  # for which C defines the shift
    inner: Callable[..., Sequence[Interval]] = lambda *_: ()  # 32-bit intermediates


def check_intervals(claims: Claims) -> None:
    """Prove every operation, store and first value; in floating point only these, for its ranges claim no word.

    Operations and stores are proven from every state in its range, and from every state that the words can hold.

    Raises
    ------
    ProofError
        at the first that does not hold.
    """
    _check_starts(claims)
    if not claims.fixed:
        return
    words, ranges = _check_operations(claims)
    _check_stores(claims, words, ranges)
    words, ranges = _check_operations(claims.from_any_state())
    _check_stores(claims, words, ranges)


def _check_operations(claims: Claims) -> tuple[dict[str, int], dict[str, Interval]]:
    """Prove every operation, and return word and range of each value."""
    words: dict[str, int] = {f"in.{v.name}": 32 for v in claims.inputs}  # what is read of an int16_t is an int
    ranges: dict[str, Interval] = {}
    for value in claims.inputs:
        half = 1 << (value.bits - 1)
        ranges[f"in.{value.name}"] = -half, half - 1  # the type's whole range: nothing is assumed of a user
    for value in claims.state:
        words[f"self.{value.name}"] = 32
        ranges[f"self.{value.name}"] = _ends(value.low, value.high)
    tables = {f"table.{table['name']}": table for table in claims.tables}
    plans: dict[str, int] = {}  # moves of each
    for op in claims.operations:
        name, claimed = op.result.name, _ends(op.result.low, op.result.high)
        if op.function in TABLES:
            table = tables[str(op.arguments[0])]
            given = [_given(op, a, "v", words, ranges) for a in op.arguments[1:]]
            wrong = TABLES[op.function](table, given, claimed)
            if wrong:
                raise ProofError(f"{name} = {op.function}(...): {wrong}")
            plans[name] = table["sizes"]["FL_QP_MOVES"]
        elif op.function in OF_A_PLAN:
            _check_part(op, plans[str(op.arguments[0])], claimed, ranges)
        else:
            _check_operation(op, claimed, words, ranges)
        words[name], ranges[name] = op.result.bits, claimed
        _check_store(f"{name}, as a word,", claimed, (-(1 << (op.result.bits - 1)), (1 << (op.result.bits - 1)) - 1))
    return words, ranges


def _check_operation(
    op: ClaimedOperation, claimed: Interval, words: Mapping[str, int], ranges: Mapping[str, Interval]
) -> None:
    rule = RULES.get(op.function)
    if rule is None:
        raise ProofError(f"{op.says()}: operation {op.function!r} is not known to the checker")
    if len(op.arguments) != len(rule.operands):
        raise ProofError(f"{op.says()}: {op.function} takes {len(rule.operands)} arguments")
    if op.result.bits != rule.bits:
        raise ProofError(f"{op.says()} gives {rule.bits} bits, {op.result.bits} are claimed")
    given = [_given(op, a, letter, words, ranges) for a, letter in zip(op.arguments, rule.operands, strict=True)]
    for (count, _), letter in zip(given, rule.operands, strict=True):
        if letter == "s" and not rule.counts[0] <= count <= rule.counts[1]:
            least, most = rule.counts
            raise ProofError(f"{op.says()}: a shift by {count}; C defines it from {least} to {most}")
    for low, high in rule.inner(*given):
        if not LEAST <= low <= high < -LEAST:
            raise ProofError(f"{op.says()} breaks its range: an intermediate of 32 bits may be {low} to {high}")
    low, high = rule.image(*given)
    if not claimed[0] <= low <= high <= claimed[1]:
        raise ProofError(
            f"{op.says()} breaks its range: it may be {low} to {high}, claimed {claimed[0]} to {claimed[1]}"
        )


def _given(
    op: ClaimedOperation, argument: Argument, letter: str, words: Mapping[str, int], ranges: Mapping[str, Interval]
) -> Interval:
    """Return the interval of an operand that has the word its place reads."""
    if not isinstance(argument, str):
        if letter == "w" or (letter != "s" and not LEAST <= argument < -LEAST):
            raise ProofError(f"{op.says()}: the constant {argument} does not fit the word that is read there")
        if letter == "t" and argument not in TRUTH:
            raise ProofError(f"{op.says()}: {argument} is no truth value")
        return int(argument), int(argument)
    if letter == "s":
        raise ProofError(f"{op.says()}: the shift count {argument} is no constant")
    bits = 64 if letter == "w" else 32
    if words[argument] != bits:
        raise ProofError(f"{op.says()}: {argument} has {words[argument]} bits where {bits} are read")
    low, high = ranges[argument]
    if letter == "t" and not (0 <= low and high <= 1):
        raise ProofError(f"{op.says()}: {argument} may be {low} to {high}, no truth value")
    return low, high


def _check_part(op: ClaimedOperation, moves: int, claimed: Interval, ranges: Mapping[str, Interval]) -> None:
    """Assert what a move or a truth value that is read from a plan may be."""
    found = TRUTH
    if op.function == "move":
        place = op.arguments[1] if len(op.arguments) == 2 else None
        if not isinstance(place, int) or not 0 <= place < moves:
            raise ProofError(f"{op.says()}: the plan has the moves 0 to {moves - 1}")
        found = ranges[str(op.arguments[0])]
    elif len(op.arguments) != 1:
        raise ProofError(f"{op.says()}: {op.function} takes one plan")
    if op.result.bits != 32:
        raise ProofError(f"{op.says()} gives 32 bits, {op.result.bits} are claimed")
    _check_store(op.result.name, found, claimed)


def _check_stores(claims: Claims, words: Mapping[str, int], ranges: Mapping[str, Interval]) -> None:
    stores = [(v, claims.following[v.name]) for v in claims.state]
    for value, source in (*stores, *zip(claims.outputs, claims.results, strict=True)):
        if words[source] != 32:
            raise ProofError(f"{value.name} is given {source}, which has {words[source]} bits")
        _check_store(value.name, ranges[source], _ends(value.low, value.high))
    for name, _, source in claims.status:
        if words[source] != 32 or ranges[source][0] < 0 or ranges[source][1] > 1:
            raise ProofError(f"status bit {name} is given {source}, which is no truth value")


def _check_store(name: str, got: Interval, allowed: Interval) -> None:
    if not (allowed[0] <= got[0] and got[1] <= allowed[1]):
        raise ProofError(f"{name} may be given {got[0]} to {got[1]}, its range is {allowed[0]} to {allowed[1]} (raw)")


def _check_starts(claims: Claims) -> None:
    """Assert the first value of each state, and what a setter can put into it; in any arithmetic."""
    started = {}
    for value, start in zip(claims.state, claims.start, strict=True):
        low = -math.inf if value.low is None else value.low
        high = math.inf if value.high is None else value.high
        started[value.name] = start, low, high
        if value.name == claims.unset:
            if start != (LEAST if claims.fixed else None):
                raise ProofError(f"state {value.name} is unset, but starts at {start}")
        elif start is None or not low <= start <= high:
            raise ProofError(f"state {value.name} starts at {start}, its range is {low} to {high} (raw)")
    for name, least, most, first in claims.parameters:
        start, low, high = started[name]
        if not low <= least <= first <= most <= high:
            raise ProofError(
                f"parameter {name} is set from {least} to {most}, first {first}: its state is {low} to {high}"
            )
        if first != start:
            raise ProofError(f"parameter {name} is first {first}, its state starts at {start}")
        if not claims.keeps(name):
            raise ProofError(f"parameter {name} is given {claims.following[name]} by a step, which must keep it")


def _ends(low: int | float | None, high: int | float | None) -> Interval:
    assert isinstance(low, int) and isinstance(high, int), "read_claims() has seen to it"
    return low, high


def _product(a: Interval, b: Interval) -> Interval:
    corners = [x * y for x in a for y in b]
    return min(corners), max(corners)


def _sum(a: Interval, b: Interval) -> Interval:
    return a[0] + b[0], a[1] + b[1]


def _down(a: Interval, s: Interval) -> Interval:
    return a[0] >> s[0], a[1] >> s[0]


def _near(a: Interval, s: Interval) -> Interval:
    half = 1 << (s[0] - 1)
    return (a[0] + half) >> s[0], (a[1] + half) >> s[0]


def _low_bits(a: Interval, s: Interval) -> Interval:
    half = 1 << (31 - s[0])
    return a if -half <= a[0] and a[1] < half else (-half, half - 1)


def _absolute(a: Interval) -> Interval:
    return max(0, a[0], -a[1]), max(-a[0], a[1])


def _chosen(condition: Interval, a: Interval, b: Interval) -> Interval:
    taken = [*([a] if condition != (0, 0) else []), *([b] if condition[0] <= 0 <= condition[1] else [])]
    return min(low for low, _ in taken), max(high for _, high in taken)


def _smaller(a: Interval, b: Interval) -> Interval:
    return min(a[0], b[0]), min(a[1], b[1])


def _larger(a: Interval, b: Interval) -> Interval:
    return max(a[0], b[0]), max(a[1], b[1])


def _truths(certain: Callable[[Interval, Interval], bool], never: Callable[[Interval, Interval], bool]) -> IntervalRule:
    return IntervalRule("vv", lambda a, b: (int(certain(a, b)), int(not never(a, b))))


def _apart(a: Interval, b: Interval) -> bool:
    return a[1] < b[0] or b[1] < a[0]


def _one(a: Interval, b: Interval) -> bool:
    return a[0] == a[1] == b[0] == b[1]


def _rules() -> Iterator[tuple[str, IntervalRule]]:
    yield "add", IntervalRule("vv", _sum)
    yield "sub", IntervalRule("vv", lambda a, b: (a[0] - b[1], a[1] - b[0]))
    yield "mul", IntervalRule("vv", _product)
    yield "neg", IntervalRule("v", lambda a: (-a[1], -a[0]))
    yield "copy", IntervalRule("v", lambda a: a)
    yield "abs", IntervalRule("v", _absolute)
    # A factor of 2^31 is no int32_t; the constant that rounds, 2^(s-1), is one up to s = 31.
    yield "shl", IntervalRule("vs", lambda a, s: (a[0] << s[0], a[1] << s[0]), counts=(0, 30))
    yield "shr", IntervalRule("vs", _near, counts=(1, 31), inner=lambda a, s: [_sum(a, (1 << (s[0] - 1),) * 2)])
    yield "asr", IntervalRule("vs", _down, counts=(1, 31))
    yield "wrap", IntervalRule("vs", _low_bits, counts=(1, 31))
    yield "wide", IntervalRule("vv", _product, bits=64)
    yield "mac", IntervalRule("wvv", lambda total, a, b: _sum(total, _product(a, b)), bits=64)
    yield "mul_down", IntervalRule("vvs", lambda a, b, s: _down(_product(a, b), s), counts=(1, 63))
    yield "high_down", IntervalRule("ws", _down, counts=(1, 63))
    # Rounded down into 32 bits first; then the last bit that was shifted out is added.
    yield (
        "mul_shift",
        IntervalRule(
            "vvs",
            lambda a, b, s: _near(_product(a, b), s),
            counts=(1, 63),
            inner=lambda a, b, s: [_down(_product(a, b), s)],
        ),
    )
    yield "mul_add", IntervalRule("vvv", lambda first, a, b: _sum(first, _near(_product(a, b), (32, 32))))
    # A core may read no more than 16 bits of the first factor, or shift it to the left in 32.
    yield (
        "mul_add_short",
        IntervalRule(
            "vvv",
            lambda first, x, b: _sum(first, _down(_product(x, b), (16, 16))),
            inner=lambda first, x, b: [(x[0] << 16, x[1] << 16)],
        ),
    )
    yield "high", IntervalRule("ws", _near, counts=(1, 63), inner=lambda a, s: [_down(a, s)])
    yield "min", IntervalRule("vv", _smaller)
    yield "max", IntervalRule("vv", _larger)
    yield "clamp", IntervalRule("vvv", lambda x, low, high: _smaller(_larger(x, low), high))
    yield "select", IntervalRule("tvv", _chosen)
    yield "lt", _truths(lambda a, b: a[1] < b[0], lambda a, b: a[0] >= b[1])
    yield "le", _truths(lambda a, b: a[1] <= b[0], lambda a, b: a[0] > b[1])
    yield "eq", _truths(_one, _apart)
    yield "ne", _truths(_apart, _one)
    yield "and", IntervalRule("tt", _smaller)
    yield "or", IntervalRule("tt", _larger)
    yield "not", IntervalRule("t", lambda a: (1 - a[1], 1 - a[0]))


def _curved_rules() -> Iterator[tuple[str, IntervalRule]]:
    """Say what fl_curved_i32.h gives; its own intermediates fit for every argument that is allowed."""
    one = (1 << 30) + 8  # of a sine in Q30, and what the polynomial may pass it by
    yield "turn", IntervalRule("vvs", lambda a, factor, s: (LEAST, -LEAST - 1), counts=(1, 32))
    yield "turn_sine", IntervalRule("v", lambda a: (-one, one))
    yield "turn_cosine", IntervalRule("v", lambda a: (-one, one))
    yield "whole_root", IntervalRule("vs", _root, counts=(1, 31))
    yield "inverse", IntervalRule("vss", _inverse, counts=(0, 30))


def _root(a: Interval, s: Interval) -> Interval:
    if a[0] < 0 or s[0] % 2 == 0:
        raise ProofError(f"a root of {a[0]} times 2^{s[0]}; it takes what is not below 0, and an odd power")
    low, high = (math.isqrt(end << s[0]) for end in a)
    return max(0, low - 2 - (low >> 25)), high + 2 + (high >> 25)


def _inverse(x: Interval, k: Interval, j: Interval) -> Interval:
    half = 1 << k[0] >> 1
    least, most = (x[0] + half) >> k[0], (x[1] + half) >> k[0]
    if not 8 <= least <= most < 1 << 17:
        raise ProofError(f"a reciprocal of {x[0]} to {x[1]} over 2^{k[0]}, which is {least} to {most}, not 8 to 2^17")
    # e^2 for the error e of the short division, which rounds its divisor and its result.
    share = (0.5 / least * (k[0] > 0) + most / 2**31) ** 2 * (1 + 1 / least)
    ends = [2.0 ** (31 + k[0] + j[0]) / end for end in (x[1], x[0])]
    return math.floor(ends[0] * (1 - share)) - 4, math.ceil(ends[1] * (1 + share)) + 4


RULES: dict[str, IntervalRule] = {**dict(_rules()), **dict(_curved_rules())}

"""Prove a fixed-point program's ranges a second time, from proof.json alone, with bit-vectors and z3.

Nothing of the prover is used, and nothing of the interval rules: this file knows the operations' meaning in C from the
words of the C standard (32-bit two's complement operands, 64-bit products, arithmetic right shift) and asks z3 for a
counterexample. For every operation, over all operand values inside their claimed ranges:

- the exact result lies in the claimed range, and the range in the word;
- no operand, constant or intermediate of the C expression leaves its type, and no shift count the width of its operand;

and for every state variable and output, that the value stored lies in the range claimed for it, as the first value of a
state and all that a setter lets through do. Both are asked a second time of a state that holds anything. A product is
taken with each factor at both ends of its range: in between it lies between these products, a lemma that z3 proves once
over the reals. So no bit-vector is ever multiplied by another, and a query takes a millisecond.

A state variable that is `unset` until the first sample may hold the least integer besides. What a search over a table
gives is left to the interval rules, and so is what a sine, root or reciprocal gives.
"""

from __future__ import annotations

import functools
import itertools
from collections.abc import Mapping, Sequence
from typing import Any

import z3

from firmloop.verify.proofs.claims import LEAST, OF_A_PLAN, PLANS, ClaimedOperation, Claims, ProofError

WIDE = 160  # holds every exact result: sums of 64-bit values, and these shifted to the left by any count that C defines
ASKED = 1 << 14  # answers that are kept
CURVED = ("turn", "turn_sine", "turn_cosine", "whole_root", "inverse")
PRODUCTS = {
    "mul": (0, 1),
    "wide": (0, 1),
    "mul_shift": (0, 1),
    "mul_down": (0, 1),
    "mac": (1, 2),
    "mul_add": (1, 2),
    "mul_add_short": (1, 2),
}  # places of the factors
READS = {"mac": (64, 32, 32), "high": (64, 0), "high_down": (64, 0)}  # bits of each operand; 0 is a shift count;
SHIFTS = {
    "shl": 1,
    "shr": 1,
    "asr": 1,
    "wrap": 1,
    "mul_shift": 2,
    "mul_down": 2,
    "high": 1,
    "high_down": 1,
}  # place of the count
MOST = {"shl": 30, "shr": 31, "asr": 31, "wrap": 31}  # of a count; 63 for the others
GIVES = {"wide": 64, "mac": 64}  # bits of the result; 32 for all others
THREE = ("clamp", "select", "mac", "mul_add", "mul_add_short", "mul_shift", "mul_down")
ARITY = {**dict.fromkeys(("neg", "abs", "copy", "not"), 1), **dict.fromkeys(THREE, 3)}
Ranges = Mapping[str, tuple[int, int]]


def check_with_z3(claims: Claims) -> None:
    """Prove every operation, store and first value.

    Raises
    ------
    ProofError
        at the first that does not hold.
    """
    _check_stores(claims, *_check_operations(claims))
    _check_stores(claims, *_check_operations(claims.from_any_state()))
    ranges = {v.name: (int(v.low or 0), int(v.high or 0)) for v in claims.state}
    for value, start in zip(claims.state, claims.start, strict=True):
        if value.name != claims.unset or start != LEAST:
            first = int(start or 0)
            _check_inside(f"{value.name} at the start", (first, first), ranges[value.name])
    for name, low, high, begins in claims.parameters:
        _check_inside(f"{name} by its setter", (int(low), int(high)), ranges[name])
        _check_inside(f"{name} at the start", (int(begins), int(begins)), (int(low), int(high)))
        if not claims.keeps(name):
            raise ProofError(f"parameter {name} is given {claims.following[name]} by a step, which must keep it")


def _check_operations(claims: Claims) -> tuple[dict[str, int], dict[str, tuple[int, int]]]:
    """Prove every operation, and return word and range of each value."""
    words: dict[str, int] = {}
    ranges: dict[str, tuple[int, int]] = {}
    for value in claims.inputs:
        half = 1 << (value.bits - 1)
        ranges[f"in.{value.name}"] = (-half, half - 1)  # the type's whole range: nothing is assumed of a user
    for value in claims.state:
        ranges[f"self.{value.name}"] = (int(value.low or 0), int(value.high or 0))
    for op in claims.operations:
        claimed = int(op.result.low or 0), int(op.result.high or 0)
        if op.function == "move":
            _check_inside(op.result.name, ranges[str(op.arguments[0])], claimed)
        elif op.function in OF_A_PLAN:
            _check_inside(op.result.name, (0, 1), claimed)
        elif op.function not in (*PLANS, *CURVED):
            _check_words(op, words)
            for arguments in _cases(op, ranges):
                _check_case(op, claimed, arguments, ranges)
        words[op.result.name], ranges[op.result.name] = op.result.bits, claimed
        _check_inside(op.result.name, claimed, (-(1 << (op.result.bits - 1)), (1 << (op.result.bits - 1)) - 1))
    return words, ranges


def _check_stores(claims: Claims, words: Mapping[str, int], ranges: Ranges) -> None:
    for value, source in (
        *((v, claims.following[v.name]) for v in claims.state),
        *zip(claims.outputs, claims.results, strict=True),
    ):
        if words.get(source, 32) != 32:
            raise ProofError(f"{value.name} is given {source}, which has {words[source]} bits")
        _check_inside(value.name, ranges[source], (int(value.low or 0), int(value.high or 0)))


def judge() -> str:
    """Return who judges here."""
    return f"z3 {z3.get_version_string()}"


def _check_inside(name: str, got: tuple[int, int], allowed: tuple[int, int]) -> None:
    """Ask for a value that is stored and not allowed."""
    if _leaves(got, allowed) or got[0] > got[1]:
        raise ProofError(f"{name} may be given {got[0]} to {got[1]}, its range is {allowed[0]} to {allowed[1]} (raw)")


@functools.lru_cache(maxsize=ASKED)
def _leaves(got: tuple[int, int], allowed: tuple[int, int]) -> bool:
    width = max(end.bit_length() for end in (*got, *allowed)) + 1
    x = z3.BitVec(f"x_{width}", width)
    return _counterexample([x >= got[0], x <= got[1]], [x >= allowed[0], x <= allowed[1]]) is not None


def _check_words(op: ClaimedOperation, words: Mapping[str, int]) -> None:
    """Assert that each operand has the word that is read, and that the count of a shift is below its width."""
    arity = ARITY.get(op.function, 2)
    reads = READS.get(op.function, (32,) * arity)
    if len(op.arguments) != arity:
        raise ProofError(f"{op.says()}: {op.function} takes {arity} arguments")
    if op.result.bits != GIVES.get(op.function, 32):
        raise ProofError(f"{op.says()} gives {GIVES.get(op.function, 32)} bits, {op.result.bits} are claimed")
    for k, argument in enumerate(op.arguments):
        if k == SHIFTS.get(op.function):
            least, most = int(op.function != "shl"), MOST.get(op.function, 63)
            if not isinstance(argument, int) or not least <= argument <= most:
                raise ProofError(f"{op.says()}: a shift by {argument}; C defines it from {least} to {most}")
        elif isinstance(argument, str) and words.get(argument, 32) != reads[k]:
            raise ProofError(f"{op.says()}: {argument} has {words.get(argument, 32)} bits where {reads[k]} are read")
        elif not isinstance(argument, str) and (reads[k] != 32 or not LEAST <= argument < -LEAST):
            raise ProofError(f"{op.says()}: the constant {argument} does not fit the word that is read there")


def _cases(op: ClaimedOperation, ranges: Ranges) -> list[list[Any]]:
    """Return the argument lists to prove the operation for: a product at the corners of its factors' ranges."""
    places = PRODUCTS.get(op.function, ())
    if places:
        _prove_product_lemma()
    ends = [
        ranges[argument] if k in places and isinstance(argument, str) else (argument,)
        for k, argument in enumerate(op.arguments)
    ]
    return [list(case) for case in itertools.product(*ends)]


@functools.cache
def _prove_product_lemma() -> None:
    """Prove that x y lies between low y and high y for low <= x <= high; rounding keeps this order."""
    x, y, low, high = z3.Reals("x y low high")
    solver = z3.Solver()
    between = z3.Or(z3.And(low * y <= x * y, x * y <= high * y), z3.And(high * y <= x * y, x * y <= low * y))
    solver.add(low <= x, x <= high, z3.Not(between))
    if solver.check() != z3.unsat:
        raise ProofError("z3 cannot prove that a product is monotone in its factors; its version is at fault")


def _check_case(op: ClaimedOperation, claimed: tuple[int, int], arguments: Sequence[Any], ranges: Ranges) -> None:
    operands = tuple(ranges[each] if isinstance(each, str) else int(each) for each in arguments)
    found = _breaks(op.function, claimed, operands)
    if found is not None:
        raise ProofError(
            f"{op.result.name} = {op.function}({', '.join(map(str, arguments))}) breaks its range: {found}"
        )


@functools.lru_cache(maxsize=ASKED)
def _breaks(function: str, claimed: tuple[int, int], operands: tuple[int | tuple[int, int], ...]) -> str | None:
    """Ask for values of the operands, each a constant or anything in a range, with which an operation breaks a claim.

    The answer is kept: of a state that holds anything, most questions are those of a state in its range.
    """
    symbols, assumed = [], []
    for k, operand in enumerate(operands):
        if isinstance(operand, tuple):
            lowest, highest = operand
            width = max(lowest.bit_length(), highest.bit_length()) + 1
            narrow = z3.BitVec(f"a{k}_{width}", width)
            assumed += [narrow >= lowest, narrow <= highest]
            symbols.append(z3.SignExt(WIDE - width, narrow))
        else:
            symbols.append(z3.BitVecVal(operand, WIDE))
    result, intermediates = _meaning(function, symbols)
    claims = [result >= claimed[0], result <= claimed[1]]
    for value, bits in intermediates:
        claims += [value >= -(1 << (bits - 1)), value <= (1 << (bits - 1)) - 1]
    return _counterexample(assumed, claims)


def _counterexample(assumed: Sequence[Any], claims: Sequence[Any]) -> str | None:
    """Return values for which a claim fails; None where z3 proves that there are none."""
    solver = _solver()
    solver.push()
    solver.add(*assumed, z3.Not(z3.And(*claims)))
    outcome = solver.check()
    found = None if outcome == z3.unsat else "no decision"
    if outcome == z3.sat:
        model = solver.model()
        values = {str(symbol).partition("_")[0]: model[symbol].as_signed_long() for symbol in model.decls()}
        found = ", ".join(f"{name} = {values[name]}" for name in sorted(values)) or "with these values"
    solver.pop()
    return found


@functools.cache
def _solver() -> z3.Solver:
    return z3.SolverFor("QF_BV")


def _meaning(function: str, a: Sequence[Any]) -> tuple[Any, list[tuple[Any, int]]]:
    """Return the exact result, and the intermediates of the C with the bits of their type."""
    one, zero = z3.BitVecVal(1, WIDE), z3.BitVecVal(0, WIDE)
    match function:
        case "add":
            return a[0] + a[1], []
        case "sub":
            return a[0] - a[1], []
        case _ if function in PRODUCTS:
            return _product(function, a)
        case "neg":
            return zero - a[0], []
        case "copy":
            return a[0], []
        case "abs":
            return z3.If(a[0] < 0, zero - a[0], a[0]), []
        case "shl":
            return a[0] << a[1], []
        case "shr":
            rounded = a[0] + (one << (a[1] - 1))
            return rounded >> a[1], [(rounded, 32)]
        case "asr" | "high_down":
            return a[0] >> a[1], []
        case "wrap":
            return (a[0] << (a[1] + WIDE - 32)) >> (a[1] + WIDE - 32), []
        case "high":  # the C adds the last bit that is shifted out to what it has rounded down into 32 bits
            return (a[0] >> a[1]) + ((a[0] >> (a[1] - 1)) & one), [(a[0] >> a[1], 32)]
        case _:
            return _choice(function, a)


def _product(function: str, a: Sequence[Any]) -> tuple[Any, list[tuple[Any, int]]]:
    """Return the same of an operation that multiplies."""
    one = z3.BitVecVal(1, WIDE)
    first, second = PRODUCTS[function]
    product = a[first] * a[second]
    match function:
        case "mul_shift":
            return (product >> a[2]) + ((product >> (a[2] - 1)) & one), [(product, 64), (product >> a[2], 32)]
        case "mac":
            return a[0] + product, []  # the product of two 32-bit values fits 64 bits, the sum is the result
        case "mul_add":  # rounded by itself, or as the lower half of 64 bits whose upper half the value is
            rounded = (product + (one << 31)) >> 32
            return a[0] + rounded, [(rounded, 32), ((a[0] << 32) + (one << 31) + product, 64)]
        case "mul_add_short":  # of 16 bits; by itself, or as the lower half of 64 bits whose upper half the value is
            rounded = product >> 16
            return a[0] + rounded, [(a[1], 16), (rounded, 32), ((a[0] << 32) + (product << 16), 64)]
        case "mul_down":
            return product >> a[2], [(product, 64)]
        case _:  # mul, wide
            return product, []


def _choice(function: str, a: Sequence[Any]) -> tuple[Any, list[tuple[Any, int]]]:
    """Return the same of an operation that chooses between values, or tells whether something is true."""
    one, zero = z3.BitVecVal(1, WIDE), z3.BitVecVal(0, WIDE)

    def truth(condition: Any) -> tuple[Any, list[tuple[Any, int]]]:
        return z3.If(condition, one, zero), []

    match function:
        case "min":
            return z3.If(a[0] < a[1], a[0], a[1]), []
        case "max":
            return z3.If(a[0] > a[1], a[0], a[1]), []
        case "clamp":
            above = z3.If(a[0] > a[1], a[0], a[1])
            return z3.If(above < a[2], above, a[2]), []
        case "select":
            return z3.If(a[0] != 0, a[1], a[2]), _truth_values(a[:1])
        case "lt":
            return truth(a[0] < a[1])
        case "le":
            return truth(a[0] <= a[1])
        case "eq":
            return truth(a[0] == a[1])
        case "ne":
            return truth(a[0] != a[1])
        case "and":
            return a[0] & a[1], _truth_values(a)
        case "or":
            return a[0] | a[1], _truth_values(a)
        case "not":
            return one - a[0], _truth_values(a)
        case _:
            raise ProofError(f"operation {function!r} is not known to the checker")


def _truth_values(a: Sequence[Any]) -> list[tuple[Any, int]]:
    """Return what fits its bits where each of `a` is 0 or 1: -a is then 0 or -1, one bit."""
    return [(-value, 1) for value in a]

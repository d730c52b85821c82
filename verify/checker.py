"""Prove a fixed-point program's ranges a second time, from proof.json alone, with bit-vectors and z3.

Nothing of the prover is used: this file knows the operations' meaning in C from the words of the C standard (32-bit
two's complement operands, 64-bit products, arithmetic right shift) and asks z3 for a counterexample. For every
operation, over all operand values inside their claimed ranges:

- the exact result lies in the claimed range, and the range in the word;
- no intermediate of the C expression overflows its type;

and for every state variable and output, that the value stored lies in the range claimed for it. A product is taken
with each factor at both ends of its range: in between it lies between these products, a lemma that z3 proves once over
the reals. So no bit-vector is ever multiplied by another, and a query takes a millisecond.

A state variable that is `unset` until the first sample may hold the least integer besides: it may only be compared with
that, and be chosen where that comparison has failed.
"""

from __future__ import annotations

import functools
import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import z3

from verify.table_checker import check_sweeps, check_tree

WIDE = 96  # holds every exact result: sums of 64-bit values and 32-bit products shifted to the left
PRODUCTS = {
    "mul": (0, 1),
    "wide": (0, 1),
    "mul_shift": (0, 1),
    "mul_down": (0, 1),
    "mac": (1, 2),
}  # places of the factors
LEAST = -(1 << 31)
TABLES = {"sweeps": check_sweeps, "tree": check_tree}  # operations over a table


class ProofError(Exception):
    """An operation that could not be proven; the message names it and gives values that break it."""


@dataclass(frozen=True, slots=True)
class Checked:
    """How many operations and stores were proven again."""

    operations: int
    stores: int


def check_proof(document: Mapping[str, Any]) -> Checked | None:
    """Prove every operation of a fixed-point proof.json; None for floating point, whose ranges are not claims on words.

    Raises
    ------
    ProofError
        at the first operation or store that does not hold.
    """
    if not str(document["arithmetic"]).startswith("fixed"):
        return None
    ranges: dict[str, tuple[int, int]] = {}
    for value in document["inputs"]:
        half = 1 << (int(value["bits"]) - 1)
        ranges[f"in.{value['name']}"] = (-half, half - 1)  # the type's whole range: nothing is assumed of a user
    for value in document["state"]:
        ranges[f"self.{value['name']}"] = (int(value["low"]), int(value["high"]))
    _check_unset(document, ranges)
    tables = {f"table.{table['name']}": table for table in document["tables"]}
    for operation in document["operations"]:
        if operation["function"] in TABLES:
            _check_table(operation, ranges, tables)
        elif operation["function"] == "move":
            _check_store(operation["name"], ranges[operation["arguments"][0]], (operation["low"], operation["high"]))
        else:
            _check_operation(operation, ranges)
        ranges[operation["name"]] = (int(operation["low"]), int(operation["high"]))
    limits = {value["name"]: (int(value["low"]), int(value["high"])) for value in document["state"]}
    for store in document["next_state"]:
        _check_store(store["state"], ranges[store["value"]], limits[store["state"]])
    for output in document["outputs"]:
        half = 1 << (int(output["bits"]) - 1)
        _check_store(output["name"], ranges[output["value"]], (-half, half - 1))
    return Checked(len(document["operations"]), len(document["next_state"]) + len(document["outputs"]))


def _check_table(
    operation: Mapping[str, Any], ranges: Mapping[str, tuple[int, int]], tables: Mapping[str, Mapping[str, Any]]
) -> None:
    table, *parameters = operation["arguments"]
    claimed = int(operation["low"]), int(operation["high"])
    wrong = TABLES[operation["function"]](tables[table], [ranges[name] for name in parameters], claimed)
    if wrong:
        raise ProofError(f"{operation['name']} = {operation['function']}(...): {wrong}")


def _check_store(name: str, got: tuple[int, int], allowed: tuple[int, int]) -> None:
    if not (allowed[0] <= got[0] and got[1] <= allowed[1]):
        raise ProofError(f"{name} may be given {got[0]} to {got[1]}, its range is {allowed[0]} to {allowed[1]} (raw)")


def _check_unset(document: Mapping[str, Any], ranges: Mapping[str, tuple[int, int]]) -> None:
    """Assert that nothing reads the unset state variable before the first sample has set it."""
    if document.get("unset") is None:
        return
    name, tests = f"self.{document['unset']}", set()
    if ranges[name][0] <= LEAST:
        raise ProofError(f"{name} may hold {LEAST} by itself, which says that it is not set")
    for operation in document["operations"]:
        arguments = list(operation["arguments"])
        if operation["function"] == "eq" and arguments == [name, LEAST]:
            tests.add(operation["name"])
            continue
        chosen = operation["function"] == "select" and arguments[0] in tests and name not in arguments[:2]
        if name in arguments and not chosen:
            raise ProofError(f"{operation['name']} reads {name}, which may not be set yet")
    if any(store["value"] == name for store in (*document["next_state"], *document["outputs"])):
        raise ProofError(f"{name} is stored as it is, but may not be set yet")


def _check_operation(operation: Mapping[str, Any], ranges: Mapping[str, tuple[int, int]]) -> None:
    low, high = int(operation["low"]), int(operation["high"])
    name = operation["name"]
    half = 1 << (int(operation.get("bits", 32)) - 1)
    if not (-half <= low <= high < half):
        raise ProofError(f"{name}: the claimed range {low} to {high} does not fit a word of {half.bit_length()} bits")
    for arguments in _cases(operation, ranges):
        _check_case(operation, arguments, ranges)


def _cases(operation: Mapping[str, Any], ranges: Mapping[str, tuple[int, int]]) -> list[list[Any]]:
    """Return the argument lists to prove the operation for: a product at the corners of its factors' ranges."""
    places = PRODUCTS.get(operation["function"], ())
    if places:
        _prove_product_lemma()
    ends = [
        ranges[argument] if k in places and isinstance(argument, str) else (argument,)
        for k, argument in enumerate(operation["arguments"])
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


def _check_case(operation: Mapping[str, Any], arguments: Sequence[Any], ranges: Mapping[str, tuple[int, int]]) -> None:
    low, high, name = int(operation["low"]), int(operation["high"]), operation["name"]
    symbols, assumed = [], []
    for k, argument in enumerate(arguments):
        if isinstance(argument, str):
            lowest, highest = ranges[argument]
            width = max(lowest.bit_length(), highest.bit_length()) + 1
            narrow = z3.BitVec(f"a{k}_{width}", width)
            assumed += [narrow >= lowest, narrow <= highest]
            symbols.append(z3.SignExt(WIDE - width, narrow))
        else:
            symbols.append(z3.BitVecVal(int(argument), WIDE))
    result, intermediates = _meaning(operation["function"], symbols)
    claims = [result >= low, result <= high]
    for value, bits in intermediates:
        claims += [value >= -(1 << (bits - 1)), value <= (1 << (bits - 1)) - 1]
    solver = _solver()
    solver.push()
    solver.add(*assumed, z3.Not(z3.And(*claims)))
    outcome = solver.check()
    model = solver.model() if outcome == z3.sat else "no decision"
    solver.pop()
    if outcome != z3.unsat:
        raise ProofError(f"{name} = {operation['function']}{tuple(arguments)} breaks its range: {model}")


@functools.cache
def _solver() -> z3.Solver:
    return z3.SolverFor("QF_BV")


def _meaning(function: str, a: Sequence[Any]) -> tuple[Any, list[tuple[Any, int]]]:
    """Return the exact result, and the intermediates of the C with the bits of their type."""
    one, zero = z3.BitVecVal(1, WIDE), z3.BitVecVal(0, WIDE)

    def truth(condition: Any) -> tuple[Any, list[tuple[Any, int]]]:
        return z3.If(condition, one, zero), []

    match function:
        case "add":
            return a[0] + a[1], []
        case "sub":
            return a[0] - a[1], []
        case "mul":
            return a[0] * a[1], []
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
        case "asr":
            return a[0] >> a[1], []
        case "mul_shift":
            rounded = a[0] * a[1] + (one << (a[2] - 1))
            return rounded >> a[2], [(rounded, 64)]
        case "wide":
            return a[0] * a[1], []
        case "mac":
            return a[0] + a[1] * a[2], []  # the product of two 32-bit values fits 64 bits, the sum is the result
        case "mul_down":
            return (a[0] * a[1]) >> a[2], [(a[0] * a[1], 64)]
        case "high_down":
            return a[0] >> a[1], []
        case "high":  # the C adds the last bit that is shifted out: the same, without a larger intermediate
            return (a[0] >> a[1]) + ((a[0] >> (a[1] - 1)) & one), []
        case "min":
            return z3.If(a[0] < a[1], a[0], a[1]), []
        case "max":
            return z3.If(a[0] > a[1], a[0], a[1]), []
        case "clamp":
            above = z3.If(a[0] > a[1], a[0], a[1])
            return z3.If(above < a[2], above, a[2]), []
        case "select":
            return z3.If(a[0] != 0, a[1], a[2]), []
        case "lt":
            return truth(a[0] < a[1])
        case "le":
            return truth(a[0] <= a[1])
        case "eq":
            return truth(a[0] == a[1])
        case "ne":
            return truth(a[0] != a[1])
        case "and":
            return a[0] & a[1], []
        case "or":
            return a[0] | a[1], []
        case "not":
            return one - a[0], []
        case "capped" | "infeasible":
            return truth(a[0] == a[0])  # either
        case _:
            raise ProofError(f"operation {function!r} is not known to the checker")

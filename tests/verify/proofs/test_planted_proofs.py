"""A wrong proof of every kind is refused: on reading it, or by each of the two judges alone."""

from __future__ import annotations

import copy
import functools
import json
from collections.abc import Callable
from typing import Any

import pytest

from firmloop.design.kinds import kinds
from firmloop.design.law import Law
from firmloop.quantize.lower.lower import lower
from firmloop.quantize.program import QuantizeError
from firmloop.quantize.proof import proof
from firmloop.verify.proofs.checker import check_proof
from firmloop.verify.proofs.claims import ProofError
from firmloop.verify.proofs.interval_checker import check_intervals
from firmloop.verify.proofs.reading import read_claims
from firmloop.verify.proofs.z3_checker import check_with_z3
from tests.laws import pid
from tests.quantize.test_sweeps import sweeping
from tests.verify.test_tunable import TUNABLE

Document = dict[str, Any]
Change = Callable[[Document], None]
INT32, INT64 = 2**31 - 1, 2**63 - 1


@functools.cache
def _made(arithmetic: str) -> str:
    law = pid({**TUNABLE, "tunable": ["kp", "ki"], "ranges": {"kp": [0.0, 0.2], "ki": [0.0, 5.0]}})
    return json.dumps(proof(lower(law, arithmetic), law.reasons))


def good(arithmetic: str = "fixed32") -> Document:
    """Return a right proof of a PID with two parameters that can be tuned."""
    found: Document = json.loads(_made(arithmetic))
    return found


def line(name: str, function: str, arguments: list[Any], low: int, high: int, bits: int = 32) -> Document:
    """Return one more operation."""
    claim = {"name": name, "unit": "", "kind": "fixed", "bits": bits, "word": bits, "fraction": 0}
    return {**claim, "low": low, "high": high, "function": function, "arguments": arguments}


def more(function: str, arguments: list[Any], low: int, high: int, bits: int = 32) -> Change:
    """Add an operation over what is there: `long` of 64 bits, `short` from -5 to 5, `least` and `most` of 32 bits."""

    def change(document: Document) -> None:
        document["operations"] += [
            line("long", "wide", ["in.reference", "in.measurement"], -(2**62) + 2**31, 2**62, 64),
            line("longest", "mac", ["long", "in.reference", INT32], -(2**63), INT64, 64),
            line("short", "clamp", ["in.reference", -5, 5], -5, 5),
            line("truth", "lt", ["short", 0], 0, 1),
            line("x", function, arguments, low, high, bits),
        ]

    return change


def put(key: str, place: int | str, name: str, value: Any) -> Change:
    """Write another value into one claim, found by its place or its name."""

    def change(document: Document) -> None:
        rows = document[key]
        known = {row.get("name", row.get("state")): row for row in rows}
        (rows[place] if isinstance(place, int) else known[place])[name] = value

    return change


def drop(key: str, place: int, name: str) -> Change:
    """Leave a key out of one claim."""
    return lambda document: document[key][place].pop(name)


def again(key: str) -> Change:
    """Say the first claim twice."""
    return lambda document: document[key].insert(1, copy.deepcopy(document[key][0]))


def top(key: str, value: Any) -> Change:
    """Write another value at the top."""
    return lambda document: document.__setitem__(key, value)


def alone(document: Document) -> None:
    """Leave nothing."""
    document.clear()


FULL = (-(2**31), INT32)
JUDGED: dict[str, Change] = {
    "shl by 31": more("shl", ["short", 31], *FULL),
    "shl by 32": more("shl", ["short", 32], *FULL),
    "shl by -1": more("shl", ["short", -1], *FULL),
    "shr by 0": more("shr", ["short", 0], -5, 5),
    "shr by 32": more("shr", ["short", 32], 0, 0),
    "shr by -3": more("shr", ["short", -3], *FULL),
    "asr by 32": more("asr", ["in.reference", 32], -1, 0),
    "asr by 33": more("asr", ["in.reference", 33], -1, 0),
    "asr by -1": more("asr", ["short", -1], *FULL),
    "wrap by 0": more("wrap", ["short", 0], -5, 5),
    "wrap by 32": more("wrap", ["short", 32], -5, 5),
    "wrap into more than is claimed": more("wrap", ["short", 29], -4, 2),
    "wrap that says too little": more("wrap", ["in.reference", 4], -(2**27) + 1, 2**27 - 1),
    "mul_shift by 0": more("mul_shift", ["short", "short", 0], -25, 25),
    "mul_shift by 64": more("mul_shift", ["short", "short", 64], 0, 0),
    "mul_shift by -2": more("mul_shift", ["short", "short", -2], *FULL),
    "mul_down by 64": more("mul_down", ["short", "short", 64], -1, 0),
    "mul_down by -1": more("mul_down", ["short", "short", -1], *FULL),
    "high by 0": more("high", ["long", 0], *FULL),
    "high by 64": more("high", ["long", 64], -1, 0),
    "high by -5": more("high", ["long", -5], *FULL),
    "high_down by 64": more("high_down", ["long", 64], -1, 0),
    "high_down by 90": more("high_down", ["long", 90], -1, 0),
    "a shift by a value": more("asr", ["in.reference", "short"], *FULL),
    "a shift that says too little": more("shl", ["short", 4], -80, 79),
    "the rounding of shr overflows": more("shr", ["in.reference", 30], -2, 2),
    "the lower half of mul_shift overflows": more("mul_shift", ["in.reference", "in.reference", 31], *FULL),
    "a product leaves the word that it is added in": more("mul_add", ["in.reference", "in.reference", 4], *FULL),
    "a product that is added, of less than is claimed": more("mul_add", ["short", "in.reference", 2**30], -5, 5),
    "64 bits where mul_add reads 32": more("mul_add", ["long", "short", "short"], -5, 5),
    "32 bits where mul_add_short reads 16": more("mul_add_short", ["short", "in.reference", 1], -(2**16), 2**16),
    "a short product leaves the word it is added in": more("mul_add_short", ["in.reference", "short", INT32], *FULL),
    "a short product that is added, of less than is claimed": more("mul_add_short", ["short", "short", 2**20], -84, 85),
    "a sum leaves its word": more("add", ["in.reference", 1], *FULL),
    "a difference leaves its word": more("sub", ["short", "in.reference"], *FULL),
    "a product leaves its word": more("mul", ["in.reference", 2], *FULL),
    "the least has no negative": more("neg", ["in.reference"], *FULL),
    "the least has no magnitude": more("abs", ["in.reference"], 0, INT32),
    "a 64-bit sum overflows": more("mac", ["longest", "in.reference", 1], -(2**63), INT64, 64),
    "add of a constant too wide": more("add", ["short", 2**31], *FULL),
    "wide of a constant too wide": more("wide", ["short", 2**40], -5 * 2**40, 5 * 2**40, 64),
    "mac of a constant too wide": more("mac", ["long", "short", -(2**31) - 1], -(2**63), INT64, 64),
    "clamp of a constant too wide": more("clamp", ["short", -(2**40), 2**40], -5, 5),
    "lt of a constant too wide": more("lt", ["short", 2**32], 0, 1),
    "eq of a constant too wide": more("eq", ["short", 2**31], 0, 1),
    "select of a constant too wide": more("select", ["truth", 2**33, "short"], *FULL),
    "64 bits where add reads 32": more("add", ["long", 1], *FULL),
    "64 bits where min reads 32": more("min", ["long", 5], *FULL),
    "64 bits where clamp reads 32": more("clamp", ["long", -5, 5], -5, 5),
    "64 bits where asr reads 32": more("asr", ["long", 31], *FULL),
    "64 bits where a comparison reads 32": more("lt", ["long", 5], 0, 1),
    "32 bits where high reads 64": more("high", ["short", 4], -1, 1),
    "32 bits where high_down reads 64": more("high_down", ["short", 4], -1, 0),
    "32 bits where mac reads 64": more("mac", ["short", "short", 3], -20, 20, 64),
    "a constant where high reads 64": more("high", [12345, 4], 700, 800),
    "a 64-bit factor": more("wide", ["long", 1], -(2**62) + 2**31, 2**62, 64),
    "a sum of 64 bits": more("add", ["short", "short"], -10, 10, 64),
    "a product of 32 bits": more("wide", ["short", "short"], -25, 25, 32),
    "an unknown operation": more("rotate", ["short", 3], *FULL),
    "a missing argument": more("clamp", ["short", -5], -5, 5),
    "an argument too many": more("add", ["short", "short", "short"], -15, 15),
    "a choice by what is no truth": more("select", ["short", 1, 2], 1, 2),
    "not of what is no truth": more("not", ["short"], -4, 6),
    "and of what is no truth": more("and", ["short", "truth"], -8, 7),
    "a truth that is claimed": more("lt", ["in.reference", 0], 1, 1),
    "a state narrower than what is stored": put("state", "integral", "high", 5),
    "an output narrower than what is stored": put("outputs", "output", "low", -5),
    "an output that is a 64-bit sum": put("outputs", "output", "value", "t1"),
    "a start above its range": put("state", "integral", "start", INT32),
    "a start below its range": put("state", "integral", "start", -INT32),
    "an unset state that starts set": put("state", "last", "start", INT32),
    "a parameter that starts outside": put("parameters", "kp", "start", -1),
    "a setter wider than the state": put("parameters", "kp", "high", INT32),
    "a setter below the state": put("parameters", "ki", "low", -1),
    "a parameter that a step changes": put("next_state", "kp", "value", "self.ki"),
}
READ: dict[str, Change] = {
    "an empty document": alone,
    "an unknown schema": top("schema", 2),
    "a schema that is a truth value": top("schema", True),
    "an unknown arithmetic": top("arithmetic", "fixed8"),
    "an unknown rounding": top("rounds", "up"),
    "no program id": lambda document: document.pop("program_id"),
    "a program id that is none": top("program_id", "xyz"),
    "operations that are no list": top("operations", {}),
    "no states": lambda document: document.pop("state"),
    "no parameters": lambda document: document.pop("parameters"),
    "no outputs": top("outputs", []),
    "unset is missing": lambda document: document.pop("unset"),
    "an unknown unset state": top("unset", "nobody"),
    "a range without an end": drop("operations", 0, "high"),
    "a word without bits": drop("operations", 0, "bits"),
    "no function": drop("operations", 0, "function"),
    "no arguments": drop("operations", 0, "arguments"),
    "a state without a start": drop("state", 0, "start"),
    "a range that is no number": put("operations", 0, "high", float("nan")),
    "an endless range": put("operations", 0, "high", float("inf")),
    "a fraction as a range": put("operations", 0, "high", 1.5),
    "a whole number as a float": put("operations", 0, "high", 1.0),
    "a truth value as a range": put("operations", 0, "high", True),
    "text as a range": put("operations", 0, "high", "1"),
    "nothing as a range": put("operations", 0, "high", None),
    "a huge range": put("operations", 0, "high", 10**40),
    "bits that are no word": put("operations", 0, "bits", 128),
    "bits and word differ": put("operations", 0, "word", 64),
    "a product of the word's own size": put("operations", 0, "product_word", 32),
    "a truth value as bits": put("state", 0, "bits", True),
    "a range of an operation beyond its word": put("operations", 0, "high", 2**31),
    "a state beyond its word": put("state", "integral", "high", 2**31),
    "a state far below its word": put("state", "integral", "low", -(2**40)),
    "a state of 64 bits": put("state", "integral", "bits", 64),
    "an output beyond its word": put("outputs", "output", "high", 2**31),
    "a range upside down": put("state", "integral", "low", INT32),
    "floats among whole numbers": put("state", "integral", "kind", "float"),
    "an argument that is a truth value": more("add", ["short", True], -4, 6),
    "an argument that is a fraction": more("add", ["short", 0.5], -4, 6),
    "an argument that is a list": more("add", ["short", [1]], -4, 6),
    "an argument that is huge": more("add", ["short", 10**30], -4, 6),
    "a state without a successor": lambda document: document["next_state"].pop(0),
    "a successor of nothing": put("next_state", 0, "state", "nobody"),
    "two successors": again("next_state"),
    "a state named twice": again("state"),
    "an input named twice": again("inputs"),
    "an output named twice": again("outputs"),
    "an operation named twice": again("operations"),
    "a parameter named twice": again("parameters"),
    "a status bit named twice": again("status"),
    "a name that is never said": more("add", ["short", "nobody"], -4, 6),
    "an input that is not there": more("add", ["short", "in.nobody"], -4, 6),
    "a value that comes later": lambda document: document["operations"].insert(0, document["operations"].pop()),
    "a value that reads itself": more("add", ["x", 1], *FULL),
    "a successor that is never said": put("next_state", 0, "value", "nobody"),
    "an output that is never said": put("outputs", 0, "value", "nobody"),
    "a status that is never said": put("status", 0, "value", "nobody"),
    "a status bit beyond the word": put("status", 0, "bit", 32),
    "a parameter that is no state": put("parameters", 0, "name", "nobody"),
    "a name that is no name in C": put("operations", -1, "name", "a; b"),
    "a move of what is no plan": more("move", ["short", 0], -5, 5),
    "a table that is not there": more("tree", ["table.nobody", "short"], -5, 5),
    "an unset state that is read": more("add", ["self.last", 0], *FULL),
}


def test_at_least_sixty_wrong_proofs_are_planted() -> None:
    assert len(JUDGED) + len(READ) + len(TABLES) >= 60


@pytest.mark.parametrize("case", JUDGED)
@pytest.mark.parametrize("judge", [check_intervals, check_with_z3])
def test_each_judge_alone_refuses(judge: Callable[[Any], None], case: str) -> None:
    document = good()
    judge(read_claims(document))
    JUDGED[case](document)
    claims = read_claims(document)
    with pytest.raises(ProofError):
        judge(claims)


@pytest.mark.parametrize("case", READ)
def test_what_is_no_proof_is_refused_on_reading(case: str) -> None:
    document = good()
    READ[case](document)
    with pytest.raises(ProofError):
        read_claims(document)


@pytest.mark.parametrize("judge", [check_intervals, check_with_z3])
def test_the_lower_half_of_a_rounded_sum_has_a_word_too(judge: Callable[[Any], None]) -> None:
    """-2^63 / 2^32 rounds to what fits, but half a unit below it what is rounded down does not."""
    for low, fits in ((-(2**46), True), (-(2**46) - 1, False)):
        document = good()
        document["operations"] += [
            line("long", "wide", ["in.reference", "in.measurement"], -(2**62) + 2**31, 2**62, 64),
            line("narrow", "clamp", ["in.reference", -(2**15), 0], -(2**15), 0),
            line("product", "wide", ["narrow", INT32], low, 0, 64),
            line("x", "high", ["product", 15], *FULL),
        ]
        claims = read_claims(document)
        if fits:
            judge(claims)
            continue
        with pytest.raises(ProofError, match="x = high"):
            judge(claims)


def _sizes(name: str, value: object) -> Change:
    return lambda document: document["tables"][0]["sizes"].__setitem__(name, value)


def _numbers(name: str, value: object) -> Change:
    return lambda document: document["tables"][0]["numbers"].__setitem__(name, value)


TABLES: dict[str, Change] = {
    "a shift by 0": _sizes("FL_SHIFT_MIX", 0),
    "a shift by -1": _sizes("FL_SHIFT_PUSH", -1),
    "a shift by the whole word": _sizes("FL_SHIFT_SLOPE", 64),
    "a size that is a truth value": _sizes("FL_QP_ROWS", True),
    "a size that is missing": lambda document: document["tables"][0]["sizes"].pop("FL_SHIFT_SCALE"),
    "no sweep": _sizes("FL_SWEEPS", 0),
    "more moves than rows": _sizes("FL_QP_MOVES", 999),
    "a member that is missing": lambda document: document["tables"][0]["numbers"].pop("reach"),
    "a member that is too short": _numbers("low", [0]),
    "a member that is a fraction": _numbers("tolerance", 0.5),
    "a list in place of a number": _numbers("reach", [1]),
    "no reach": _numbers("reach", 0),
    "a move that is not there": lambda document: next(
        op for op in document["operations"] if op["function"] == "move"
    ).__setitem__("arguments", ["plan", 99]),
    "a plan of 64 bits": lambda document: next(op for op in document["operations"] if op["function"] == "move").update(
        bits=64, word=64
    ),
}


@functools.cache
def _swept() -> str:
    law = sweeping()
    return json.dumps(proof(lower(law, "fixed32"), law.reasons))


@pytest.mark.parametrize("case", TABLES)
def test_a_wrong_table_is_refused(case: str) -> None:
    document = json.loads(_swept())
    check_intervals(read_claims(document))
    TABLES[case](document)
    with pytest.raises(ProofError):
        check_intervals(read_claims(document))


@functools.cache
def _examples() -> list[Law]:
    return [kind.design(request).law for kind in kinds().values() for request in kind.examples.values()]


@pytest.mark.parametrize("arithmetic", ["fixed32", "fixed16", "float32", "float64"])
def test_every_kind_is_accepted(arithmetic: str) -> None:
    seen = 0
    for law in _examples():
        try:
            program = lower(law, arithmetic)
        except QuantizeError:
            assert arithmetic.startswith("fixed")
            continue
        assert (check_proof(proof(program, law.reasons)) is not None) == arithmetic.startswith("fixed")
        seen += 1
    assert seen > 10


@pytest.mark.parametrize("change", [put("state", "integral", "start", 1e9), put("parameters", "kp", "high", 9.0)])
def test_floating_point_proves_its_first_values_and_setters(change: Change) -> None:
    document = good("float32")
    assert check_proof(document) is None
    change(document)
    with pytest.raises(ProofError):
        check_proof(document)

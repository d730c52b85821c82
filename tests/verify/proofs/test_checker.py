"""The second proof holds for what the generator emits, and fails for what is wrong."""

import json
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from firmloop.design.kinds import kinds
from firmloop.quantize.lower.lower import lower
from firmloop.quantize.proof import proof
from firmloop.verify.proofs.checker import ProofError, check_proof
from firmloop.verify.proofs.claims import Claims
from firmloop.verify.proofs.interval_checker import check_intervals
from firmloop.verify.proofs.reading import read_claims
from firmloop.verify.proofs.z3_checker import check_with_z3
from tests.laws import FULL, TABLES, pid, random_law

TUNED = {**FULL, "tunable": ["kp"], "ranges": {"kp": [0.0, 0.2]}}


def document(arithmetic: str, table: str = "full") -> dict[str, Any]:
    law = pid(TUNED if table == "tuned" else TABLES[table])
    return json.loads(json.dumps(proof(lower(law, arithmetic), law.reasons)))


@pytest.mark.parametrize("arithmetic", ["fixed32", "fixed16"])
@pytest.mark.parametrize("table", ["full", "clamping", "narrow"])
def test_every_operation_is_proven_again(table: str, arithmetic: str) -> None:
    found = document(arithmetic, table)
    checked = check_proof(found)
    assert checked is not None and checked.operations == len(found["operations"]) > 15


def test_random_laws_are_proven_again() -> None:
    for seed in range(1):
        law = random_law(np.random.default_rng(seed))
        program = lower(law, "fixed32")
        checked = check_proof(json.loads(json.dumps(proof(program, law.reasons))))
        assert checked is not None and checked.operations == len(program.body)


def test_floating_point_makes_no_claim_on_words() -> None:
    law = pid(FULL)
    assert check_proof(proof(lower(law, "float32"), law.reasons)) is None


def named(found: dict[str, Any], function: str) -> dict[str, Any]:
    return next(o for o in found["operations"] if o["function"] == function)


ONE_BY_ONE = ("mul_add", "mul_add_short", "sub", "max", "clamp", "select", "shl")


@pytest.mark.parametrize(
    ("arithmetic", "table", "function"),
    [
        *(("fixed32", "full", name) for name in ("wide", "mac", "high")),
        *(("fixed16", "full", name) for name in ONE_BY_ONE),
        ("fixed16", "tuned", "mul_shift"),
    ],
)
def test_a_range_claimed_too_small_is_refused(arithmetic: str, table: str, function: str) -> None:
    found = document(arithmetic, table)
    named(found, function)["high"] -= 1
    with pytest.raises(ProofError):
        check_proof(found)


def test_a_state_that_is_not_set_yet_is_read_by_its_test_alone() -> None:
    found = document("fixed32")
    assert found["unset"] == "filtered"
    named(found, "sub")["arguments"][1] = "self.filtered"
    with pytest.raises(ProofError, match=r"reads self\.filtered, which may not be set yet"):
        check_proof(found)


def test_a_missing_limit_is_refused() -> None:
    found = document("fixed32")
    sums = [op for op in found["operations"] if "integral_held" in op["arguments"]]
    assert [op["function"] for op in sums] == ["add", "add"]
    for op in sums:
        op["arguments"][0] = "self.integral"
    with pytest.raises(ProofError, match=r"add\(self\.integral, t\d+\) breaks its range"):
        check_proof(found)


@pytest.mark.parametrize("judge", [check_intervals, check_with_z3])
def test_a_limit_that_only_a_flipped_bit_can_reach_is_missed_when_it_is_gone(judge: Callable[[Claims], None]) -> None:
    law = kinds()["transfer_function"].design(kinds()["transfer_function"].example).law
    found = json.loads(json.dumps(proof(lower(law, "fixed32"), law.reasons)))
    cut = next(op for op in found["operations"] if op["function"] == "wrap")
    state = next(v for v in found["state"] if f"self.{v['name']}" == cut["arguments"][0])
    assert (state["low"], state["high"]) == (cut["low"], cut["high"])  # the wrap changes nothing there
    judge(read_claims(found))
    for op in found["operations"]:
        op["arguments"] = [cut["arguments"][0] if a == cut["name"] else a for a in op["arguments"]]
    with pytest.raises(ProofError, match=rf"\(self\.{state['name']}, .* breaks its range"):
        judge(read_claims(found))


@pytest.mark.parametrize("judge", [check_intervals, check_with_z3])
def test_a_range_from_any_state_that_is_claimed_too_small_is_refused(judge: Callable[[Claims], None]) -> None:
    found = document("fixed32")
    found["any_state"] = [{"name": "t3", "low": -5, "high": 5}]
    with pytest.raises(ProofError, match=r"t3 = high.* breaks its range"):
        judge(read_claims(found))


@pytest.mark.parametrize("arithmetic", ["fixed32", "fixed16"])
@pytest.mark.parametrize("judge", [check_intervals, check_with_z3])
def test_a_parameter_that_a_flipped_bit_may_change_is_limited_and_stored(
    judge: Callable[[Claims], None], arithmetic: str
) -> None:
    found = document(arithmetic, "tuned")
    stored = next(s for s in found["next_state"] if s["state"] == "kp")
    assert stored["value"] == "kp_held"
    judge(read_claims(found))
    stored["value"] = "self.kp"
    with pytest.raises(ProofError, match="kp may be given"):
        judge(read_claims(found))


def test_a_rounding_constant_that_overflows_is_refused() -> None:
    found = document("fixed32")
    found["operations"].append(
        named(found, "sub") | {"name": "x", "function": "shr", "arguments": ["in.reference", 30], "low": -2, "high": 2}
    )
    with pytest.raises(ProofError, match="x = shr"):
        check_proof(found)

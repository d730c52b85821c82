"""The second proof holds for what the generator emits, and fails for what is wrong."""

import json
from typing import Any

import numpy as np
import pytest

from firmloop.quantize.lower.lower import lower
from firmloop.quantize.proof import proof
from firmloop.verify.proofs.checker import ProofError, check_proof
from tests.laws import FULL, TABLES, pid, random_law


def document(arithmetic: str, table: str = "full") -> dict[str, Any]:
    law = pid(TABLES[table])
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


@pytest.mark.parametrize("function", ["wide", "mac", "high", "sub", "max", "clamp", "select", "shl"])
def test_a_range_claimed_too_small_is_refused(function: str) -> None:
    found = document("fixed16")
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
    store = next(s for s in found["next_state"] if s["state"] == "integral")
    store["value"] = "integral_new"
    with pytest.raises(ProofError, match="integral may be given"):
        check_proof(found)


def test_a_rounding_constant_that_overflows_is_refused() -> None:
    found = document("fixed32")
    found["operations"].append(
        named(found, "sub") | {"name": "x", "function": "shr", "arguments": ["in.reference", 30], "low": -2, "high": 2}
    )
    with pytest.raises(ProofError, match="x = shr"):
        check_proof(found)

"""Prove a fixed-point program's ranges twice more, from proof.json alone: by interval rules, and by z3."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from firmloop.verify.proofs.claims import ProofError
from firmloop.verify.proofs.interval_checker import check_intervals
from firmloop.verify.proofs.reading import read_claims

__all__ = ["Checked", "ProofError", "check_proof"]


@dataclass(frozen=True, slots=True)
class Checked:
    """How many operations and stores were proven again."""

    operations: int
    stores: int


def check_proof(document: Mapping[str, Any]) -> Checked | None:
    """Prove every claim of a proof.json; None for floating point, where only first values and setters are claims.

    Raises
    ------
    ProofError
        when the document is no proof, or at the first claim that one of the judges refuses.
    """
    claims = read_claims(document)
    check_intervals(claims)
    if not claims.fixed:
        return None
    from firmloop.verify.proofs.z3_checker import check_with_z3  # only fixed point waits for z3

    check_with_z3(claims)
    return Checked(len(claims.operations), len(claims.state) + len(claims.outputs))

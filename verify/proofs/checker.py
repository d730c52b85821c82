"""Prove a fixed-point program's ranges twice more, from proof.json alone: by interval rules, and by z3."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from firmloop.verify.judgement import PROVEN, Judgement
from firmloop.verify.proofs.claims import ProofError
from firmloop.verify.proofs.judge import Delivered
from firmloop.verify.proofs.judges import every_judge
from firmloop.verify.proofs.reading import read_claims

__all__ = ["Checked", "ProofError", "check_proof"]


@dataclass(frozen=True, slots=True)
class Checked:
    """How many operations and stores were proven again, and what each judge said."""

    operations: int
    stores: int
    judgements: tuple[Judgement, ...]


def check_proof(document: Mapping[str, Any]) -> Checked | None:
    """Prove every claim of a proof.json; None for floating point, where only first values and setters are claims.

    Raises
    ------
    ProofError
        when the document is no proof, or at the first claim that one of the judges refuses.
    """
    claims = read_claims(document)
    delivered = Delivered(claims, None)
    found = [judge.judge(delivered) for judge in every_judge().values() if judge.own and judge.asked(delivered)]
    for judgement in found:
        if judgement.result != PROVEN:
            raise ProofError(judgement.says)
    if not claims.fixed:
        return None
    return Checked(len(claims.operations), len(claims.state) + len(claims.outputs), tuple(found))

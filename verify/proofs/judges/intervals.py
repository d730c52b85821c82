"""Judge the ranges of proof.json by interval rules in exact whole numbers."""

from __future__ import annotations

from importlib.metadata import version

from firmloop.verify.judgement import PROVEN, REFUTED
from firmloop.verify.proofs.claims import ProofError
from firmloop.verify.proofs.interval_checker import check_intervals
from firmloop.verify.proofs.judge import Delivered, Judge


def _run(delivered: Delivered) -> tuple[str, str]:
    try:
        check_intervals(delivered.claims)
    except ProofError as error:
        return REFUTED, str(error)
    return PROVEN, ""


JUDGE = Judge(
    name="intervals",
    claim="every operation, store and first value keeps its range and word, from every state a word can hold",
    install="pip install firmloop",
    own=True,
    floats=True,
    version=lambda: version("firmloop"),
    run=_run,
)

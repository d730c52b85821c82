"""Judge the ranges of proof.json by bit-vectors and z3."""

from __future__ import annotations

from firmloop.verify.judgement import PROVEN, REFUTED
from firmloop.verify.proofs.claims import ProofError
from firmloop.verify.proofs.judge import Delivered, Judge


def _version() -> str | None:
    try:
        import z3  # only fixed point waits for it
    except ImportError:
        return None
    return str(z3.get_version_string())


def _run(delivered: Delivered) -> tuple[str, str]:
    from firmloop.verify.proofs.z3_checker import check_with_z3  # with z3

    try:
        check_with_z3(delivered.claims)
    except ProofError as error:
        return REFUTED, str(error)
    return PROVEN, ""


JUDGE = Judge(
    name="z3",
    claim="every operation, store and first value keeps its range and word, from every state a word can hold",
    install="pip install z3-solver",
    own=True,
    floats=False,
    version=_version,
    run=_run,
)

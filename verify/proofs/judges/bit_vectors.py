"""Judge the ranges of proof.json by bit-vectors and z3."""

from __future__ import annotations

from firmloop.verify.proofs.judge import RANGES, Delivered, Judge, result_of


def _version() -> str | None:
    try:
        import z3  # only fixed point waits for it
    except ImportError:
        return None
    return str(z3.get_version_string())


def _run(delivered: Delivered) -> tuple[str, str]:
    from firmloop.verify.proofs.z3_checker import check_with_z3  # with z3

    return result_of(check_with_z3, delivered)


JUDGE = Judge(
    name="z3",
    claim=RANGES,
    install="pip install z3-solver",
    own=True,
    floats=False,
    version=_version,
    run=_run,
)

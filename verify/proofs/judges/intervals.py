"""Judge the ranges of proof.json by interval rules in exact whole numbers."""

from __future__ import annotations

from importlib.metadata import version

from firmloop.verify.proofs.interval_checker import check_intervals
from firmloop.verify.proofs.judge import RANGES, Delivered, Judge, result_of


def _run(delivered: Delivered) -> tuple[str, str]:
    return result_of(check_intervals, delivered)


JUDGE = Judge(
    name="intervals",
    claim=RANGES,
    install="pip install firmloop",
    own=True,
    floats=True,
    version=lambda: version("firmloop"),
    run=_run,
)

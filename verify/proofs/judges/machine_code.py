"""Judge linked images: that the machine code of the step computes what proof.json states, whatever comes in.

The machine code is lifted by VEX, the intermediate language of angr, and compared by the solver Bitwuzla, cut at the
values of the operations. The compiler and its library are so judged too. Assumed are the ranges of states and
operations, which other judges prove. Images are DIR/images/<target>.elf; `firmloop prove PROJECT --out DIR` links them.
"""

from __future__ import annotations

import time
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from firmloop.verify.judgement import NOT_RUN, PROVEN, REFUTED, TIMEOUT, UNKNOWN
from firmloop.verify.proofs.claims import Claims
from firmloop.verify.proofs.judge import IMAGES, Delivered, Judge
from firmloop.verify.proofs.machine.image import read_code
from firmloop.verify.proofs.machine.solver import APART, EQUAL
from firmloop.verify.proofs.machine.step import step_ways
from firmloop.verify.proofs.machine.sweep import StepComparison, ranges_of
from firmloop.verify.proofs.machine.terms import Pool
from firmloop.verify.proofs.machine.vex import UndecidedError

LONGEST = 120.0  # s for an image; a PID takes 2 of a free processor


def _version() -> str | None:
    """Return the versions of both packages, None where one is not here."""
    try:
        return f"pyvex {version('pyvex')}, bitwuzla {version('bitwuzla')}"
    except PackageNotFoundError:
        return None


def judge_image(claims: Claims, path: Path) -> tuple[str, str]:
    """Return the result for one image, and words on it."""
    begin = time.monotonic()
    try:
        code = read_code(path)
        if claims.program_id.encode() not in code.flash:
            return REFUTED, f"it does not run program {claims.program_id}: it is stale, or of another project"
        pool = Pool()
        pool.ranges.update(ranges_of(claims))
        compared = StepComparison(pool, claims, step_ways(pool, claims, code), begin + LONGEST)
        apart = compared.difference()
        if apart is not None:
            return REFUTED, apart
        said, where = compared.prove()
    except UndecidedError as error:
        return UNKNOWN, str(error)
    if said == APART:
        return REFUTED, where
    if said == EQUAL:
        return PROVEN, ""
    spent = time.monotonic() - begin
    return (TIMEOUT if spent >= LONGEST else UNKNOWN), f"{where} is not decided in {spent:.0f} s"


def _run(delivered: Delivered) -> tuple[str, str]:
    images = delivered.images
    if not images:
        return NOT_RUN, "there is no linked image to judge, DIR/images/<target>.elf"
    found = [(path.stem, *judge_image(delivered.claims, path)) for path in images]
    worst = next((one for result in (REFUTED, UNKNOWN, TIMEOUT) for one in found if one[1] == result), None)
    proven = [name for name, result, _ in found if result == PROVEN]
    if worst is None:
        return PROVEN, f"on {', '.join(proven)}"
    also = f"; proven on {', '.join(proven)}" if proven else ""
    return worst[1], f"{worst[0]}: {worst[2]}{also}"


JUDGE = Judge(
    name="machine_code",
    claim="the machine code of the step leaves in outputs, state and status what the operations state, for every input "
    "and every state in its range",
    install="pip install 'firmloop[machine_code]'",
    own=False,
    floats=False,
    version=_version,
    run=_run,
    of=IMAGES,
)

"""Judge a certificate that the closed loop keeps its bounds for ever, in exact rational arithmetic.

loop.json states a linear plant whose parameters lie in intervals, how the program is wired to it, and bounds that hold
from rest on, however the reference moves within its reach. `firmloop prove PROJECT --out DIR` finds and writes it. The
judge reads the program from proof.json, encloses the sampled plant itself, and takes nothing from what found the bounds
but numbers that it checks. That the equations are those of the machine, no judge can say.
"""

from __future__ import annotations

from importlib.metadata import version

from firmloop.verify.judgement import NOT_RUN, PROVEN, REFUTED, UNKNOWN
from firmloop.verify.proofs.claims import ProofError
from firmloop.verify.proofs.forever.check import check
from firmloop.verify.proofs.forever.stated import Stated, read_stated
from firmloop.verify.proofs.judge import LOOP, Delivered, Judge


def _run(delivered: Delivered) -> tuple[str, str]:
    claims, document = delivered.claims, delivered.loop
    if document is None:
        return NOT_RUN, "there is no loop.json to judge; `firmloop prove PROJECT --out DIR --judge for_ever` writes it"
    if document.get("found") is False:
        return UNKNOWN, f"no certificate was found: {document.get('why')}"
    try:
        stated = read_stated(document)
        check(claims, stated)
    except ProofError as error:
        return REFUTED, str(error)
    return PROVEN, says(stated)


def says(stated: Stated) -> str:
    """Say what a certificate bounds, in words."""
    states = len(stated.equations.entries["a"])
    unit = stated.units[states]
    drives = [
        f"|{name}| <= {max(float(part.levels[states + k]) for part in stated.parts):.4g}"
        for k, name in enumerate(stated.drives)
    ]
    follows = (
        f"with {stated.reference} anywhere within {float(stated.rest_reference):.4g} +-{float(stated.reach):.4g} "
        f"{unit}, "
        if stated.reference is not None
        else ""
    )
    bounds = ", ".join([f"|error| <= {float(stated.error):.4g} {unit}", *drives])
    unsure = sum(low < high for _, low, high in stated.equations.parameters)
    return f"{follows}{bounds}, and no limit acts, for every plant in {unsure} intervals"


JUDGE = Judge(
    name="for_ever",
    claim="around the plant of loop.json, whatever its parameters in their intervals, the program keeps error, plant "
    "and outputs within the bounds stated, for ever",
    install="pip install firmloop",
    own=True,
    floats=False,
    version=lambda: version("firmloop"),
    run=_run,
    of=LOOP,
)

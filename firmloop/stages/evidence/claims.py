"""A Claim: one statement on the delivered C, who judged it, and with what result."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from firmloop.stages.analysis import Loop
from firmloop.stages.making import Generated
from firmloop.stages.proving import Proving
from firmloop.stages.verification import Outcome
from firmloop.verify.build.static_checks import CPPCHECK, StaticFinding, StaticReading
from firmloop.verify.judgement import NOT_RUN, PROVEN, REFUTED, Judgement

SAME_BITS, RANGES, ROUNDING, DEFINED, MISRA, LOOP, STATED = (
    "same bits",
    "ranges",
    "rounding",
    "defined",
    "misra",
    "loop",
    "stated",
)
MOST_TOLD = 5  # findings in a claim; the SARIF report has all


@dataclass(frozen=True, slots=True)
class Claim:
    """One statement and its result.

    `about` and `of` say which requirements rest on it; `holds` is None where it is not decided.
    """

    about: str
    of: str  # the output, target or judge
    says: str
    judge: str
    version: str  # empty where the judge is not installed
    result: str
    holds: bool | None
    detail: str = ""

    @property
    def name(self) -> str:
        """What it is called among all claims."""
        return f"{self.about}: {self.of}"


def claims(
    generated: Generated,
    loop: Loop | None,
    outcomes: Sequence[Outcome],
    proving: Proving,
    readings: Sequence[StaticReading],
) -> tuple[Claim, ...]:
    """Return every claim that somebody was asked to judge, or that nobody could."""
    return (
        *_compared(outcomes),
        *(_judged(one, proving.claims.fixed) for one in (*proving.judgements, *proving.absent)),
        _stated(proving),
        *_rounding(generated, outcomes),
        *_defined(outcomes),
        *_read(readings),
        *([_loop(loop)] if loop is not None else []),
    )


def _compared(outcomes: Sequence[Outcome]) -> Iterator[Claim]:
    for outcome in outcomes:
        says = f"every output and status word on {outcome.target} is, bit for bit, that of the program"
        verdict = outcome.verdict
        if verdict is None:
            yield Claim(SAME_BITS, outcome.target, says, outcome.target, "", NOT_RUN, None, outcome.not_run)
            continue
        built = f"{verdict.compiler} {' '.join(verdict.flags)}"
        figures = f"{verdict.steps:,} steps, seed {verdict.seed}, {verdict.differences:,} differences"
        result = "agrees" if verdict.agrees else "differs"
        yield Claim(
            SAME_BITS, outcome.target, says, f"compared on {outcome.target}", built, result, verdict.agrees, figures
        )


def _judged(one: Judgement, fixed: bool) -> Claim:
    holds = {PROVEN: True, REFUTED: False}.get(one.result)
    if not fixed and one.result == PROVEN:
        detail = "nothing is claimed of words in floating point"
        return Claim(RANGES, one.judge, one.claim, one.judge, one.version, "unknown", None, detail)
    return Claim(RANGES, one.judge, one.claim, one.judge, one.version, one.result, holds, one.says)


def _stated(proving: Proving) -> Claim:
    says = "the C has the statements that proof.json proves, word by word, and no others"
    refuted = bool(proving.refuted)
    result = REFUTED if refuted else "compared"
    return Claim(STATED, "C", says, "firmloop prove", "", result, not refuted, proving.refuted)


def _rounding(generated: Generated, outcomes: Sequence[Outcome]) -> Iterator[Claim]:
    worst: dict[str, float] = {}
    for outcome in outcomes:
        for each in outcome.verdict.rounding if outcome.verdict else ():
            worst[each.output] = max(worst.get(each.output, 0.0), each.worst)
    for bound in generated.program.rounding:
        known = math.isfinite(bound.bound)
        says = (
            f"one step of {bound.output} is at most {bound.bound:.3g} {bound.unit} off the law"
            if known
            else (f"how far one step of {bound.output} is off the law is bounded")
        )
        seen = f"worst seen: {worst[bound.output]:.3g} {bound.unit}" if bound.output in worst else ""
        result = PROVEN if known else "unknown"
        yield Claim(ROUNDING, bound.output, says, "rounding followed", "", result, True if known else None, seen)


def _defined(outcomes: Sequence[Outcome]) -> Iterator[Claim]:
    """Give what the sanitizers of this machine found; they run once, whichever the targets are."""
    ran = [outcome.verdict for outcome in outcomes if outcome.verdict]
    for verdict in ran[:1]:
        found, why = verdict.undefined, verdict.sanitizers_not_run
        result = "found" if found else NOT_RUN if why else "nothing found"
        holds = False if found else None if why else True
        detail = found.sentence() if found else why or f"{verdict.sanitized:,} steps"
        says = "no step does what C leaves undefined"
        yield Claim(DEFINED, "sanitizers", says, "gcc's sanitizers", "", result, holds, detail)


def _read(readings: Sequence[StaticReading]) -> Iterator[Claim]:
    """Give what static checks found; a finding that is no rule of MISRA is to be read, for it may be a false alarm."""
    for reading in readings:
        says = f"{reading.tool} has no warning on any path through the C"
        yield _reading(
            DEFINED, says, reading, [each for each in reading.findings if not (each.of_misra or each.reason)], None
        )
        if reading.tool == CPPCHECK:
            bare = [each for each in reading.findings if each.of_misra and not each.reason]
            yield _reading(MISRA, "the C departs from MISRA C in nothing but what has a reason", reading, bare, False)


def _reading(
    about: str, says: str, reading: StaticReading, found: Sequence[StaticFinding], holds: bool | None
) -> Claim:
    """Return the claim that a tool found nothing; `holds` is what it means if it did."""
    tool, version = reading.tool, reading.version
    if reading.not_run:
        return Claim(about, tool, says, tool, version, NOT_RUN, None, reading.not_run)
    detail = "; ".join(f"{each.file}:{each.line}: {each.says}" for each in found[:MOST_TOLD])
    if found:
        return Claim(about, tool, says, tool, version, f"{len(found)} found", holds, detail)
    return Claim(about, tool, says, tool, version, "nothing found", True)


def _loop(loop: Loop) -> Claim:
    margins = loop.margins
    figures = f"gain margin {margins.gain_margin_db:.3g} dB, phase margin {margins.phase_margin_deg:.3g} deg"
    says = "the loop of the law with the fitted plant is stable"
    result = "stable" if margins.stable else "unstable"
    return Claim(LOOP, "margins", says, "linear analysis", "", result, margins.stable, figures)

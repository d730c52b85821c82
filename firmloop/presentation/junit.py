"""Write what a verification found as a JUnit report, which continuous integration shows: a case a claim and target."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from firmloop.console import visible
from firmloop.presentation.words import about_outcome

if TYPE_CHECKING:
    from firmloop.stages.baseline import Growth
    from firmloop.stages.verification import Outcome

Case = tuple[str, str, str, str]  # its target, its name, what became of it (empty where it passed), and the words


def junit(name: str, outcomes: Sequence[Outcome], grown: Sequence[Growth]) -> str:
    """Return the report of the project called `name`; what was not run is an error, and no pass."""
    cases = [case for outcome in outcomes for case in _cases(outcome)]
    cases += [("cost", each.figure, "failure" if each.too_much else "", each.says()) for each in grown]
    count = {what: str(sum(case[2] == what for case in cases)) for what in ("failure", "error")}
    suite = Element(
        "testsuite", name=name, tests=str(len(cases)), failures=count["failure"], errors=count["error"], skipped="0"
    )
    for target, claim, ended, words in cases:
        case = SubElement(suite, "testcase", classname=f"{name}.{visible(target)}", name=visible(claim))
        said = visible(words)
        if ended:
            SubElement(case, ended, message=said.splitlines()[0], type=ended).text = said
        else:
            SubElement(case, "system-out").text = said
    whole = Element("testsuites")
    whole.append(suite)
    indent(whole, " ")
    return f'<?xml version="1.0" encoding="utf-8"?>\n{tostring(whole, encoding="unicode")}\n'


def _cases(outcome: Outcome) -> Iterator[Case]:
    verdict = outcome.verdict
    if verdict is None:
        yield outcome.target, "same bits as the reference", "error", f"not run: {outcome.not_run}"
        return
    lines = "\n".join(about_outcome(outcome))
    yield outcome.target, "same bits as the reference", "failure" if verdict.differences else "", lines
    if verdict.undefined is not None:
        yield outcome.target, "no undefined behavior", "failure", verdict.undefined.sentence()
    elif verdict.sanitizers_not_run:
        yield outcome.target, "no undefined behavior", "error", f"not run: {verdict.sanitizers_not_run}"
    else:
        steps = f"{verdict.sanitized:,} steps under the sanitizers of this machine"
        yield outcome.target, "no undefined behavior", "", steps

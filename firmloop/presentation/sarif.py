"""Write what was found in the C as SARIF 2.1.0, which code hosts show beside the lines: a run a tool."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from firmloop.codegen.emit import tool_version
from firmloop.console import visible

if TYPE_CHECKING:
    from firmloop.codegen.bundle import Bundle
    from firmloop.stages.verification import Outcome
    from firmloop.verify.build.static_checks import StaticReading

SCHEMA = "https://json.schemastore.org/sarif-2.1.0.json"
DIFFERS, UNDEFINED = "differs-from-reference", "undefined-behavior"
RULES = {
    DIFFERS: "an output or the status word is not, bit for bit, that of the reference",
    UNDEFINED: "a sanitizer stopped the C: it did what C does not define",
}


@dataclass(frozen=True, slots=True)
class SarifResult:
    """One line of a report; `reason` is why it is right so, empty where nothing explains it."""

    rule: str
    level: str  # error | warning | note
    says: str
    file: str  # of the C, without folders
    line: int
    reason: str = ""


@dataclass(frozen=True, slots=True)
class _ToolRun:
    tool: str
    version: str
    rules: Mapping[str, str]
    results: Sequence[SarifResult]
    not_run: Sequence[str] = field(default_factory=tuple)


def sarif(sources: Path, bundle: Bundle | None, outcomes: Sequence[Outcome], readings: Sequence[StaticReading]) -> str:
    """Return the report; `sources` is the folder of the C, which code hosts know from where the command is run.

    `bundle` is None where there is no C, because no target could be run.
    """
    texts = bundle.files if bundle is not None else {}
    main = bundle.sources[0] if bundle is not None else ""
    runs = [_verified(main, outcomes), *(_read(one) for one in readings)]
    document = {
        "$schema": SCHEMA,
        "version": "2.1.0",
        "runs": [_run_document(one, sources, texts) for one in runs],
    }
    return json.dumps(document, indent=1, allow_nan=False) + "\n"


def _verified(main: str, outcomes: Sequence[Outcome]) -> _ToolRun:
    """Return what the verification found: undefined behavior at its line, a difference at the C of the step."""
    results, not_run = [], []
    for outcome in outcomes:
        verdict = outcome.verdict
        if verdict is None:
            not_run.append(f"{outcome.target} was not run: {outcome.not_run}")
            continue
        if verdict.undefined is not None:
            found = verdict.undefined
            results.append(SarifResult(UNDEFINED, "error", found.sentence(), found.file or main, found.line or 1))
        if verdict.first is not None:
            first = verdict.first
            says = f"{outcome.target}: {verdict.differences:,} steps differ, the first at step {first.step}: "
            says += f"{first.output} is {first.got:g} and must be {first.expected:g} {first.unit}: {first.operation}"
            results.append(SarifResult(DIFFERS, "error", says, main, 1))
        if verdict.sanitizers_not_run:
            not_run.append(f"the sanitizers were not run: {verdict.sanitizers_not_run}")
    return _ToolRun("firmloop", tool_version(), RULES, results, tuple(dict.fromkeys(not_run)))


def _read(reading: StaticReading) -> _ToolRun:
    results = [
        SarifResult(each.rule, "note" if each.reason else "warning", each.says, each.file, each.line, each.reason)
        for each in reading.findings
    ]
    rules = {each.rule: each.says for each in reading.findings}
    return _ToolRun(reading.tool, reading.version, rules, results, (reading.not_run,) if reading.not_run else ())


def _run_document(run: _ToolRun, sources: Path, texts: Mapping[str, str]) -> dict[str, object]:
    driver: dict[str, object] = {
        "name": run.tool,
        "rules": [{"id": rule, "shortDescription": {"text": visible(says)}} for rule, says in run.rules.items()],
    }
    if run.version:
        driver["version"] = run.version
    notes = [{"level": "error", "message": {"text": visible(f"{run.tool}: {why}")}} for why in run.not_run]
    return {
        "tool": {"driver": driver},
        "invocations": [{"executionSuccessful": not notes, "toolExecutionNotifications": notes}],
        "results": [_result_document(one, sources, texts) for one in run.results],
    }


def _result_document(one: SarifResult, sources: Path, texts: Mapping[str, str]) -> dict[str, object]:
    lines = texts.get(one.file, "").splitlines()
    text = lines[one.line - 1].strip() if 0 < one.line <= len(lines) else ""
    same = hashlib.sha256(f"{one.rule}\0{one.file}\0{text}".encode()).hexdigest()[:32]
    place = {"artifactLocation": {"uri": _uri(sources / one.file)}, "region": {"startLine": max(one.line, 1)}}
    document: dict[str, object] = {
        "ruleId": one.rule,
        "level": one.level,
        "message": {"text": visible(one.says)},
        "locations": [{"physicalLocation": place}],
        "partialFingerprints": {"ruleAndLine/v1": same},  # of a line that has only moved, it stays
    }
    if one.reason:
        document["suppressions"] = [{"kind": "external", "status": "accepted", "justification": one.reason}]
    return document


def _uri(path: Path) -> str:
    """Return a path as seen from where the command is run, for that is where a code host looks; else a whole one."""
    near = os.path.relpath(path)
    whole = Path(os.path.abspath(path))
    return whole.as_uri() if near.startswith("..") else Path(near).as_posix()

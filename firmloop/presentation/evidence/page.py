"""Write evidence.html: requirements, claims, judges, results, and of which files and tools they are."""

from __future__ import annotations

import html
from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING

from firmloop.codegen.misra import EDITIONS
from firmloop.presentation.page import Origin, page
from firmloop.presentation.sections import page_table
from firmloop.stages.evidence.requirements import MET, NOT_MET, OPEN

if TYPE_CHECKING:
    from firmloop.stages.evidence.evidence import EvidenceFile


def about_evidence(evidence: EvidenceFile) -> list[str]:
    """Count the requirements by how they stand, and name those that are not met or open."""
    count = Counter(one.status for one in evidence.requirements)
    words = ", ".join(f"{count[status]} {status}" for status in (MET, OPEN, NOT_MET))
    rest = [f"  {one.status}: {one.key}: {one.says}" for one in evidence.requirements if one.status != MET]
    return [f"evidence: {len(evidence.requirements)} requirements: {words}", *rest]


def evidence_page(evidence: EvidenceFile, command: str) -> str:
    """Return the page."""
    document = evidence.as_dict()
    sections = [
        f"<h1>{html.escape(evidence.project.name)}: evidence</h1>",
        *(f"<p>{html.escape(line)}</p>" for line in about_evidence(evidence)[:1]),
        "<h2>Requirements</h2>",
        page_table(
            ("key", "requirement", "status", "rests on"),
            [(one.key, one.says, one.status, "; ".join(c.name for c in one.claims)) for one in evidence.requirements],
        ),
        "<h2>Assumptions</h2>",
        _named(("key", "assumption"), document["assumptions"]),
        "<h2>Claims, judges and results</h2>",
        page_table(
            ("claim", "result", "says", "judge", "version", ""),
            [(one.name, one.result, one.says, one.judge, one.version, one.detail) for one in evidence.claims],
        ),
        *_list("<h2>Not judged</h2>", evidence.not_judged),
        f"<h2>Departures from {' and '.join(EDITIONS)}</h2>",
        page_table(("rule", "category", "hits", "reason"), _departures(document["misra"])),
        "<h2>Of what this is the evidence</h2>",
        _named(("program", ""), document["program"]),
        _named(("software", "version"), document["versions"]),
        _named(("recording", "SHA-256"), document["recordings"]),
        _named(("file", "SHA-256"), document["files"]),
        _named(("bill of materials (SPDX)", ""), document["spdx"]),
        _named(("project", ""), document["project"]),
    ]
    return page(evidence.project.name, "evidence", sections, Origin(command, ()))


def _named(head: Sequence[str], entries: object) -> str:
    assert isinstance(entries, dict)
    return page_table(head, [(str(key), "unknown" if value is None else str(value)) for key, value in entries.items()])


def _list(title: str, lines: Sequence[str]) -> list[str]:
    return [title, *(f"<p>{html.escape(line)}</p>" for line in lines)]


def _departures(misra: object) -> list[tuple[str, str, str, str]]:
    assert isinstance(misra, dict)
    return [
        (rule, one["category"], "not counted" if one["hits"] is None else str(one["hits"]), one["reason"])
        for rule, one in misra["deviations"].items()
    ]

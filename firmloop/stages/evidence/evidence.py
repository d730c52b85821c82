"""Evidence as a document: the same project, tools and recordings give the same bytes, and two can be compared."""

from __future__ import annotations

import hashlib
import json
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from firmloop.codegen.emit import tool_version
from firmloop.codegen.misra import EDITIONS, deviations
from firmloop.project.project import Project
from firmloop.project.table import ProjectError
from firmloop.stages.data import Data
from firmloop.stages.evidence.claims import Claim
from firmloop.stages.evidence.requirements import Requirement, assumptions
from firmloop.stages.making import Generated
from firmloop.verify.build.static_checks import CPPCHECK, StaticReading

SCHEMA = 1
FILE = "evidence.json"
LIBRARIES = ("casadi", "numpy", "scipy")  # that decide the last digits of a fit
MOST_SHOWN = 120  # characters of a value that differs


@dataclass(frozen=True, slots=True)
class EvidenceFile:
    """All that is filed: what is required, on what that rests, and of which files, tools and recordings it is."""

    project: Project
    generated: Generated
    files: Mapping[str, str]  # of the C and around it, by name
    data: Data
    requirements: tuple[Requirement, ...]
    claims: tuple[Claim, ...]
    readings: tuple[StaticReading, ...]
    not_judged: tuple[str, ...]

    def as_dict(self) -> dict[str, object]:
        """Return evidence.json; what is listed stands under names, so that a difference can be named."""
        program = self.generated.program
        spdx = f"{program.name}/{program.name}.spdx.json"
        recordings = {one.source: one.sha256 for one in (*self.data.train, *self.data.test)}
        return {
            "schema": SCHEMA,
            "project": {
                "name": self.project.name,
                "sha256": hashlib.sha256(self.project.path.read_bytes()).hexdigest(),
            },
            "program": {"id": program.id, "arithmetic": program.arithmetic, "period_s": program.period},
            "requirements": {
                one.key: {"says": one.says, "status": one.status, "claims": [claim.name for claim in one.claims]}
                for one in self.requirements
            },
            "assumptions": assumptions(self.project),
            "claims": {
                one.name: {
                    "says": one.says,
                    "judge": one.judge,
                    "version": one.version or None,
                    "result": one.result,
                    "detail": one.detail or None,
                }
                for one in self.claims
            },
            "misra": {"editions": list(EDITIONS), "deviations": _deviations(self.readings)},
            "not_judged": list(self.not_judged),
            "versions": {"firmloop": tool_version(), **{name: _installed(name) for name in LIBRARIES}},
            "recordings": recordings,
            "files": {name: _sum(text) for name, text in sorted(self.files.items())},
            "spdx": {"file": spdx, "sha256": _sum(self.files[spdx])},
        }


def _deviations(readings: Sequence[StaticReading]) -> Mapping[str, object]:
    """Return each rule with its reason, and how often it was hit; null where nothing has counted."""
    (checked,) = (one for one in readings if one.tool == CPPCHECK)
    hits = Counter(each.rule.rpartition("-")[2] for each in checked.findings if each.of_misra)
    return {
        rule: {"category": one.category, "reason": one.why, "hits": None if checked.not_run else hits[rule]}
        for rule, one in deviations().items()
    }


def _installed(name: str) -> str | None:
    try:
        return version(name)
    except PackageNotFoundError:
        return None


def _sum(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


def filed(folder: Path) -> Mapping[str, object] | None:
    """Return the evidence that is filed in a folder; None where there is none.

    Raises
    ------
    ProjectError
        when what stands there cannot be read as evidence.
    """
    path = folder / FILE
    if not path.exists():
        return None
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, ValueError, RecursionError):
        document = None
    if not isinstance(document, dict) or document.get("schema") != SCHEMA:
        raise ProjectError(f"--evidence {folder}: {FILE} there is no evidence that this firmloop reads; move it away")
    return document


def evidence_differences(before: object, after: object, place: str = "") -> Iterator[str]:
    """Name everything that is not as it was, by its place in the document."""
    if isinstance(before, Mapping) and isinstance(after, Mapping):
        for key in dict.fromkeys((*before, *after)):
            inner = f"{place} / {key}" if place else str(key)
            if key not in after:
                yield f"{inner}: is no more"
            elif key not in before:
                yield f"{inner}: is new: {_shown(after[key])}"
            else:
                yield from evidence_differences(before[key], after[key], inner)
    elif before != after:
        yield f"{place}: {_shown(before)} -> {_shown(after)}"


def _shown(value: object) -> str:
    text = value if isinstance(value, str) else json.dumps(value)
    return text if len(text) <= MOST_SHOWN else f"{text[:MOST_SHOWN]}..."

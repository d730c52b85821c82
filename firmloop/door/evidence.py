"""Collect the evidence of a walk, to be filed."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from firmloop.codegen.bundle import write_files
from firmloop.door.run import Run
from firmloop.identify.simulation.scratch import scratch_folder
from firmloop.presentation.documents import as_json
from firmloop.presentation.evidence.page import evidence_page
from firmloop.stages.evidence.claims import claims
from firmloop.stages.evidence.evidence import FILE, EvidenceFile, evidence_differences
from firmloop.stages.evidence.requirements import requirements
from firmloop.stages.plant import command_of
from firmloop.stages.progress import Stage, quietly
from firmloop.stages.proving import NOT_JUDGED, prove
from firmloop.verify.build.static_checks import read_statically


@dataclass(frozen=True, slots=True)
class Evidenced:
    """The evidence of a walk, and in what it is not what was filed before; empty where it is the same."""

    evidence: EvidenceFile
    differences: tuple[str, ...]

    def files(self) -> Mapping[str, str]:
        """Return the text of evidence.json and evidence.html; of evidence_new where older evidence differs."""
        names = ["evidence_new.json" if self.differences else FILE]
        names.append(names[0].replace(".json", ".html"))
        command = command_of("run --evidence", self.evidence.project.path)
        return dict(zip(names, (as_json(self.evidence.as_dict()), evidence_page(self.evidence, command)), strict=True))


def evidence(made: Run, before: Mapping[str, object] | None, *, stage: Stage = quietly) -> Evidenced:
    """Let every judge judge the C of a walk, and say on what each requirement of its project rests.

    Parameters
    ----------
    made
        a whole walk
    before
        the evidence that is filed already, None where there is none
    """
    code = made.code
    with scratch_folder(Path(tempfile.gettempdir()), "firmloop_evidence") as folder:
        write_files(code.files, folder)
        with stage("asking the judges"):
            proving = prove(folder, ())
    with stage("reading the C with static checks"):
        readings = read_statically(code.generated.bundle)
    found = claims(code.generated, made.designed.loop, made.verified.outcomes, proving, readings)
    asked = requirements(code.project, made.designed.gains, code.program, found)
    collected = EvidenceFile(
        code.project, code.generated, code.files, made.identified.data, asked, found, readings, NOT_JUDGED
    )
    differences = () if before is None else tuple(evidence_differences(before, collected.as_dict()))
    return Evidenced(collected, differences)

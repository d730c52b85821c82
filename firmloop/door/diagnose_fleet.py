"""Diagnose the recordings of many machines of one type, each on its own and then against the others."""

from __future__ import annotations

import hashlib
import os
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from firmloop.codegen.emit import tool_version
from firmloop.door.diagnose import Diagnosed, diagnose
from firmloop.door.given import check_noun, folder_given, path_given
from firmloop.door.identify import Identified, identify
from firmloop.door.load import load
from firmloop.identify.error import IdentifyError
from firmloop.identify.plants.plant import Plant
from firmloop.identify.simulation.scratch import scratch_folder
from firmloop.identify.units import unit_of
from firmloop.presentation.documents import finite, result_json
from firmloop.presentation.fleet.columns import fleet_csv, fleet_parquet
from firmloop.presentation.fleet.page import fleet_page, fleet_sections
from firmloop.presentation.fleet.words import fleet_document
from firmloop.presentation.notebook import notebook
from firmloop.project.project import Project, require
from firmloop.project.recordings_part import Recordings
from firmloop.project.table import ProjectError
from firmloop.stages.fleet.compare import Compared, compare
from firmloop.stages.fleet.kept import keep, kept_member
from firmloop.stages.fleet.member import Estimated, FleetTask, Key, Member
from firmloop.stages.fleet.pools.local import local, processors
from firmloop.stages.fleet.pools.pool import Failed, Pool
from firmloop.stages.fleet.recordings import FleetRecording, find_fleet
from firmloop.stages.plant import command_of, plant_of
from firmloop.stages.progress import Stage, quietly


@dataclass(frozen=True, slots=True)
class FleetDiagnosed:
    """What the recordings of a fleet say.

    Attributes
    ----------
    project
        the machine's type
    members
        what each recording says by itself, machine by machine, in order of time
    compared
        which machines are not like the others
    failed
        recordings without a result though nothing is wrong with them, and why
    taken
        how many results are those of an earlier run
    """

    project: Project
    members: tuple[Member, ...]
    compared: Compared
    failed: Mapping[str, str]
    taken: int

    def files(self) -> Mapping[str, str]:
        """Return the text of fleet.json, fleet.csv and fleet.html."""
        command = command_of("diagnose --fleet", self.project.path)
        return {
            "fleet.json": result_json(fleet_document(self.members, self.compared, self.failed)),
            "fleet.csv": fleet_csv(self.members, self.compared),
            "fleet.html": fleet_page(self.project.name, command, self.members, self.compared),
        }

    def parquet(self) -> bytes | None:
        """Return fleet.csv as a Parquet file; None where pyarrow is not installed."""
        return fleet_parquet(self.members, self.compared)

    def _repr_html_(self) -> str:
        return notebook(fleet_sections(self.members, self.compared))


def diagnose_fleet(
    project: Project, where: str, folder: str | Path, *, pool: Pool | None = None, stage: Stage = quietly
) -> FleetDiagnosed:
    """Diagnose every recording of a fleet on its own, and compare the machines.

    Parameters
    ----------
    project
        with `[plant]`, the type of the machines; `[recordings]` says how to read the files, and names none of them
    where
        a folder of recordings, or a pattern that matches them: a file is a machine, or a folder within it is one
    folder
        what each recording says is kept there, in `machines`; a second call takes it, if recording, project and
        firmloop are the same
    pool
        where the work is done; as many processes as this machine has processors where none is given

    Raises
    ------
    ProjectError
        when the project is wrong, no recording is found, or `folder` cannot be written.
    ToolError
        when the C compiler or the cluster is not there.
    """
    check_noun("diagnose_fleet", project, Project)
    require(project, "plant")
    plant_of(project)
    path_given("where:", where, "machines")
    kept = folder_given(folder)
    recordings = find_fleet(os.fspath(where), kept)
    asked = _Asked(project, kept, recordings)
    failed: dict[str, str] = {}
    with stage("diagnosing the fleet") as report:
        for task, answer in (pool or local(processors()))(examined, asked.tasks()):
            if isinstance(answer, Failed):
                failed[task.name] = answer.says
            else:
                keep(kept, answer)
                asked.found[task.name] = answer
            done = len(asked.found) + len(failed)
            report(done / len(recordings), f"{done} of {len(recordings)} recordings")
    members = tuple(asked.found[one.name] for one in recordings if one.name in asked.found)
    return FleetDiagnosed(project, members, compare(members), failed, asked.taken)


class _Asked:
    """The recordings of a fleet as tasks; what an earlier run has kept is found at once."""

    def __init__(self, project: Project, folder: Path, recordings: Sequence[FleetRecording]) -> None:
        self._folder, self._recordings = folder, recordings
        self._file, self._text = project.path.name, project.path.read_bytes()
        self.found: dict[str, Member] = {}
        self.taken = 0

    def tasks(self) -> Iterator[FleetTask]:
        """Give what is still to do; a recording is read when its turn comes."""
        project = hashlib.sha256(self._text).hexdigest()
        for one in self._recordings:
            content = one.path.read_bytes()
            key = Key(hashlib.sha256(content).hexdigest(), project, tool_version())
            kept = kept_member(self._folder, one.name, key)
            if kept is None:
                yield FleetTask(self._file, self._text, one.machine, one.name, one.path.name, content, key)
            else:
                self.found[one.name] = kept
                self.taken += 1


def examined(task: FleetTask) -> Member:
    """Diagnose one recording, wherever this runs; one that cannot be used is a result, too."""
    nothing = Member(task.machine, task.name, task.key)
    with scratch_folder(Path(tempfile.gettempdir()), "firmloop_fleet") as folder:
        project, recording = folder / task.project_file, folder / task.file
        project.write_bytes(task.project)
        recording.write_bytes(task.content)
        try:
            alone = _only(load(project), recording)
            return _member(nothing, identify(alone), diagnose(alone))
        except (IdentifyError, ProjectError) as error:
            return replace(nothing, refused=str(error).replace(f"{folder}/", ""))


def _only(project: Project, recording: Path) -> Project:
    """Return the project with one recording, read as `[recordings]` says."""
    given = project.recordings or Recordings((), (), {}, project.document.table("recordings").table("conditioning"))
    return replace(project, recordings=replace(given, train=(recording,), test=()))


def _member(nothing: Member, fitted: Identified, found: Diagnosed) -> Member:
    scores = fitted.fit.train[0].scores
    return replace(
        nothing,
        parameters=_estimates(fitted.plant),
        beside=_estimates(found.diagnosis.plant),
        rest={name: Estimated(figures.rmse, None, unit_of(name), True) for name, figures in scores.items()},
        diagnosis=found.finding.as_dict(),
    )


def _estimates(plant: Plant) -> Mapping[str, Estimated]:
    return {
        one.name: Estimated(one.value, _known(one.deviation), one.unit, one.logarithmic)
        for one in plant.parameters
        if one.free
    }


def _known(deviation: float | None) -> float | None:
    found = finite(deviation)
    return found if isinstance(found, float) else None

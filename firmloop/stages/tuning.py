"""Tune a project's loop by several rules."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from firmloop.design.analysis.contest import Entry, contest
from firmloop.design.analysis.small_signal import NeverFreeError
from firmloop.design.design import Design, Request
from firmloop.design.tuning import rules
from firmloop.identify.plants.plant import Plant
from firmloop.identify.simulation.linearize import linearize
from firmloop.project.project import Project
from firmloop.stages.plant import located
from firmloop.stages.reachable import Beyond, beyond_reach, explained

SEARCHING = ("iae", "ise", "itae")  # rules that take seconds, in `tune` or where they are asked for


def compare(project: Project, plant: Plant, usual: Sequence[str]) -> tuple[Entry, ...]:
    """Tune the project's loop by every rule that `[tuning]` names, those of `usual` where it names none."""
    part, asked = project.controller, project.document.table("tuning")
    assert part is not None, "require() has seen to it"
    if part.kind != "pid":
        raise part.table.wrong("kind", 'is no pid, and tuning rules give the gains of one; take kind = "pid"')
    asked.only(("rules", *rules()))
    names = asked.texts("rules", 'rules = ["simc", "amigo"]') or tuple(usual)
    for name in names:
        if name not in rules():
            raise asked.wrong("rules", f"{name!r} is no tuning rule; known: {', '.join(rules())}")
    own: dict[str, Mapping[str, object]] = {}
    for name in names:
        keys = asked.table(name)
        keys.only(rules()[name].keys)
        own[name] = keys.values
    request = Request(
        project.name, part.settings, part.period, project.controller_inputs, project.controller_outputs, plant
    )
    with located(project):
        try:
            return contest(request, names, own)
        except NeverFreeError as error:
            raise explained(error, request.inputs, request.outputs, plant, linearize(plant)) from None


def out_of_reach(project: Project, plant: Plant) -> Beyond | None:
    """Tell what the project's reference asks for beyond what its actuator holds; None where there is nothing."""
    with located(project):
        return beyond_reach(project.controller_inputs, project.controller_outputs, plant, linearize(plant))


def beside(project: Project, design: Design, plant: Plant) -> tuple[Entry, ...]:
    """Compare the rules beside a PID that one of them has tuned, or where `[tuning]` asks for it.

    Taken are those that `[tuning]` names, else the design's own and all that take no search.
    """
    asked = bool(design.tuned_by) or "tuning" in project.document.values
    if project.controller is None or project.controller.kind != "pid" or not asked:
        return ()
    return compare(project, plant, [name for name in rules() if name not in SEARCHING or name == design.tuned_by])

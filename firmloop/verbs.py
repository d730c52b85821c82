"""What each command does: the stages it needs, the files it leaves, and the exit status."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from firmloop.codegen.bundle import write_files
from firmloop.codegen.target import load_target
from firmloop.console import Console, complain, progress, table
from firmloop.design.design import Design
from firmloop.generate import as_json, c_files, generate_files, written
from firmloop.identify.fitting.fit import Fit
from firmloop.identify.plants.plant import Plant
from firmloop.identify.recordings.recording import read_recording, write_recording
from firmloop.identify.simulation.compiler import ToolError
from firmloop.output import results_file, results_folder
from firmloop.presentation import documents, words
from firmloop.presentation.figures import LIMIT, search_figure
from firmloop.presentation.report import Walk, report
from firmloop.project.project import Campaign, Project, require
from firmloop.project.project_text import designed_text, fitted_text
from firmloop.project.table import ProjectError
from firmloop.stages.baseline import check_baseline, growths
from firmloop.stages.pipeline import (
    Data,
    Generated,
    Loop,
    Outcome,
    Start,
    analyze,
    as_recorded,
    at_rest,
    available_data,
    command_of,
    located,
    plant_of,
    predicted,
    read_data,
    recorded_inputs,
    try_here,
    verify_target,
)
from firmloop.stages.pipeline import design as design_stage
from firmloop.stages.pipeline import identify as identify_stage
from firmloop.stages.tracking import Tracking, tracking
from firmloop.tuning import about_contest, beside, contest_document
from firmloop.verify.trial import Trial

__all__ = ["as_recorded", "at_rest", "design", "identify", "run", "simulate", "verify", "walk"]

AGREES, DIFFERS, NO_TOOL = 0, 1, 3
VERDICTS = ("verdict.json", "verdict_*.json", "search_*.svg", "cost.json")  # of an older run, none may stay


def identify(project: Project, out: Path, console: Console) -> int:
    """Fit the plant; OUT/project.toml holds it."""
    require(project, "plant", "recordings")
    with results_folder(out, ()) as folder:
        fitted = _fit(project, read_data(project), console)
        write_files({"project.toml": fitted_text(project, fitted.plant, out)}, folder)
    written(console, out, ["project.toml"])
    return AGREES


def simulate(project: Project, recording: Path, out: Path, start: Start, console: Console) -> int:
    """Predict the outputs of one recording; the file OUT has the same columns and rows."""
    require(project, "plant")
    if out.resolve() == recording.resolve():
        raise ProjectError(f"--out {out}: is the recording itself; choose another file")
    named = project.recordings
    read = read_recording(recording, named.rename, named.hold) if named else read_recording(recording, {})
    with results_file(out) as partial, progress("simulating"):
        write_recording(predicted(project, read, start), partial)
    written(console, out.parent, [out.name])
    return AGREES


def design(project: Project, out: Path, console: Console) -> int:
    """Tune the controller; OUT/design.json holds gains, margins and step metrics, OUT/project.toml the gains."""
    require(project, "controller", "signals")
    with results_folder(out, ()) as folder:
        plant = plant_of(project) if project.plant else None
        designed, loop = _design(project, plant, console)
        tuned = beside(project, designed, plant) if plant else ()
        console.lines(about_contest(tuned) if tuned else [])
        tuning = {"tuning": contest_document(tuned)} if tuned else {}
        files = {
            "design.json": as_json({"schema": 1, **documents.design_document(designed, loop), **tuning}),
            "project.toml": designed_text(project, designed, out),
        }
        write_files(files, folder)
    written(console, out, files)
    return AGREES


def verify(project: Project, campaign: Campaign, out: Path, console: Console) -> int:
    """Generate, build, run on every target against the reference; OUT/verdict.json."""
    require(project, "controller", "signals", "arithmetic")
    _check_targets(project, campaign)
    if campaign.baseline is not None:
        check_baseline(campaign.baseline, campaign.targets)
    with results_folder(out, VERDICTS) as folder:
        plant = plant_of(project) if project.plant else None
        designed = design_stage(project, plant)
        generated = generate_files(project, designed, "generate", console)
        _track(project, designed, generated, plant, console)
        outcomes = _verify(project, designed, generated, campaign, available_data(project), console)
        if not any(outcome.verdict for outcome in outcomes):
            raise ToolError("; ".join(f"{outcome.target} was not run: {outcome.not_run}" for outcome in outcomes))
        grown = _baseline(campaign, outcomes, console)
        files = {**c_files(generated), **_verdict_files(outcomes)}
        write_files(files, folder)
    written(console, out, files)
    return _status(outcomes) or (DIFFERS if grown else AGREES)


def run(project: Project, campaign: Campaign, out: Path, console: Console) -> int:
    """Walk from the recordings to the verdict and the report."""
    require(project, "recordings", "plant", "controller", "signals", "arithmetic")
    _check_targets(project, campaign)
    with results_folder(out, VERDICTS) as folder:
        made = walk(project, campaign, console)
        with progress("writing the report"):
            page = report(made)
        files = {
            "project.toml": fitted_text(project, made.fit.plant, out),
            **c_files(made.generated),
            **_verdict_files(made.outcomes),
            "report.html": page,
        }
        write_files(files, folder)
    written(console, out, files)
    return _status(made.outcomes)


def _check_targets(project: Project, campaign: Campaign) -> None:
    """Read every target's file before minutes of work, so that a wrong one is told at once."""
    with located(project):
        for name in campaign.targets:
            load_target(name)


def walk(project: Project, campaign: Campaign, console: Console) -> Walk:
    """Go through every stage, recordings to verdicts, and tell each result as it comes."""
    data = read_data(project)
    fitted = _fit(project, data, console)
    designed, loop = _design(project, fitted.plant, console)
    with progress("tuning by other rules"):
        tuned = beside(project, designed, fitted.plant)
    generated = generate_files(project, designed, "run", console)
    tracked = _track(project, designed, generated, fitted.plant, console)
    outcomes = _verify(project, designed, generated, campaign, data, console)
    command = command_of("run", project.path)
    return Walk(project, command, data, fitted, designed, loop, generated, outcomes, tuned, tracked)


def _fit(project: Project, data: Data, console: Console) -> Fit:
    with progress("fitting the plant") as bar:
        fitted = identify_stage(project, data, bar)
    console.lines(words.about_fit(fitted))
    console.result("plant", documents.fit_document(fitted))
    return fitted


def _design(project: Project, plant: Plant | None, console: Console) -> tuple[Design, Loop | None]:
    with progress("designing the controller"):
        designed = design_stage(project, plant)
        loop = analyze(project, designed, plant) if plant else None
    console.lines(words.about_design(designed) + (words.about_loop(loop) if loop else []))
    console.result("controller", documents.design_document(designed, loop))
    return designed, loop


def _track(
    project: Project, designed: Design, generated: Generated, plant: Plant | None, console: Console
) -> Tracking | None:
    """Follow a wave with and without the feedforward, where there is one and this machine can build the C."""
    with progress("following a wave"):
        try:
            found = tracking(project, designed, generated.program, plant)
        except ToolError as error:
            complain(f"the tracking of the feedforward was not run: {error}")
            return None
    if found is not None:
        console.lines(words.about_tracking(found))
        console.result("tracking", found.as_dict())
    return found


def _verify(
    project: Project, designed: Design, generated: Generated, campaign: Campaign, data: Data, console: Console
) -> tuple[Outcome, ...]:
    recorded = recorded_inputs(project, data, campaign.steps)
    with progress("verifying on this machine") as bar:
        trial = try_here(project, designed, generated, campaign, recorded, bar)
    outcomes: list[Outcome] = []
    for name in campaign.targets:
        if isinstance(trial, Trial):
            with progress(f"verifying on {name}") as bar:
                outcome = verify_target(project, designed, trial, name, campaign, bar)
        else:
            outcome = trial[len(outcomes)]
        console.lines(words.about_outcome(outcome))
        outcomes.append(outcome)
    console.result("verdicts", documents.outcomes_document(outcomes))
    return tuple(outcomes)


def _baseline(campaign: Campaign, outcomes: Sequence[Outcome], console: Console) -> bool:
    """Tell how the costs stand to those of an older verdict; whether one has grown by more than is allowed."""
    if campaign.baseline is None:
        return False
    found = growths(campaign.baseline, campaign.growth, outcomes)
    console.lines([f"against {campaign.baseline}:", *table([(growth.figure, growth.says()) for growth in found])])
    console.result("baseline", {growth.figure: [growth.before, growth.now] for growth in found})
    return any(growth.too_much for growth in found)


def _status(outcomes: Sequence[Outcome]) -> int:
    """Choose the exit status; a difference counts for more than a target or a sanitizer that is not there."""
    for outcome in outcomes:
        if outcome.not_run:
            complain(f"{outcome.target} was not run: {outcome.not_run}")
    unchecked = {o.verdict.sanitizers_not_run for o in outcomes if o.verdict} - {""}
    for why in unchecked:
        complain(f"the sanitizers were not run: {why}")
    if any(outcome.verdict and not outcome.verdict.agrees for outcome in outcomes):
        return DIFFERS
    return NO_TOOL if unchecked or any(outcome.not_run for outcome in outcomes) else AGREES


def _verdict_files(outcomes: Sequence[Outcome]) -> dict[str, str]:
    """One file a target, and one more where it searched; cost.json holds all costs.

    verdict.json is the first that differs, else the last.
    """
    verdicts = [outcome.verdict for outcome in outcomes if outcome.verdict]
    files = {f"verdict_{verdict.target}.json": as_json(verdict.as_dict()) for verdict in verdicts}
    if verdicts:
        shown = next((verdict for verdict in verdicts if not verdict.agrees), verdicts[-1])
        files["verdict.json"] = as_json(shown.as_dict())
        files["cost.json"] = as_json(documents.cost_document(outcomes))
    return files | {f"search_{v.target}.svg": search_figure(v.searches, LIMIT) for v in verdicts if v.searches}

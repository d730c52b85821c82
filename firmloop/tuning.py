"""`firmloop tune`: every tuning rule on one plant, in one table."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Mapping, Sequence
from pathlib import Path

from firmloop.codegen.bundle import write_files
from firmloop.console import Console, progress, table
from firmloop.design.analysis.contest import Entry, contest
from firmloop.design.design import Design, Request
from firmloop.design.tuning import rules
from firmloop.identify.plants.plant import Plant
from firmloop.output import results_folder
from firmloop.presentation.documents import fields_document, finite
from firmloop.presentation.words import no_finer
from firmloop.project.project import Project, require
from firmloop.stages.pipeline import located, plant_of

HEAD = (
    *("", "kp", "ki", "kd", "Ms", "gain margin", "phase margin", "rise", "settling 2 %", "overshoot"),
    *("step IAE", "load peak", "load IAE", "noise gain"),
)
SEARCHING = ("iae", "ise", "itae")  # rules that take seconds, in `tune` or where they are asked for
MARGINS = ("sensitivity_peak", "gain_margin_db", "phase_margin_deg")
COLUMNS = (
    *("rule", "kp", "ki", "kd", "ms", "gain_margin_dB", "phase_margin_deg", "rise_s", "settling_2_s"),
    *("overshoot_percent", "step_iae", "load_peak", "load_recovery_s", "load_iae", "noise_gain", "refused"),
)


def tune(project: Project, out: Path, console: Console) -> int:
    """Compare the rules; OUT/tuning.json and tuning.csv hold the table."""
    require(project, "plant", "controller", "signals")
    with results_folder(out, ()) as folder:
        with progress("tuning by every rule"):
            entries = compare(project, plant_of(project), tuple(rules()))
        document = {"schema": 1, "rules": contest_document(entries)}
        write_files({"tuning.json": json.dumps(document, indent=1) + "\n", "tuning.csv": _csv(entries)}, folder)
    console.lines(about_contest(entries))
    console.result("tuning", document["rules"])
    console.lines([f"written: {out / 'tuning.csv'}"])
    console.result("written", [str(out / "tuning.json"), str(out / "tuning.csv")])
    return 0


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
        return contest(request, names, own)


def beside(project: Project, design: Design, plant: Plant) -> tuple[Entry, ...]:
    """Compare the rules beside a PID that one of them has tuned, or where `[tuning]` asks for it.

    Taken are those that `[tuning]` names, else the design's own and all that take no search.
    """
    asked = bool(design.tuned_by) or "tuning" in project.document.values
    if project.controller is None or project.controller.kind != "pid" or not asked:
        return ()
    return compare(project, plant, [name for name in rules() if name not in SEARCHING or name == design.tuned_by])


def about_contest(entries: Sequence[Entry]) -> list[str]:
    """One line a rule; below, what the rules that do not fit say."""
    refused = [f"  {entry.rule}: {entry.refused}" for entry in entries if entry.refused]
    rows = [HEAD, *contest_rows(entries)]
    note = ["  note: no more digits than the plant's 95 % intervals leave; tuning.json says what they are worth"]
    lines = ["tuning rules on one plant", *table(rows), *(note if any(entry.halves for entry in entries) else [])]
    return lines + (["not for this plant:", *refused] if refused else [])


def contest_rows(entries: Sequence[Entry]) -> list[tuple[str, ...]]:
    """One row a rule, under HEAD; none for a rule that does not fit."""
    return [_row(entry) for entry in entries if not entry.refused]


def _row(entry: Entry) -> tuple[str, ...]:
    assert entry.design is not None and entry.margins is not None
    gains = tuple(f"{entry.design.gains[name]:.4g}" for name in ("kp", "ki", "kd"))
    if entry.step is None or entry.load is None:
        return (entry.rule, *gains, "UNSTABLE", *[""] * (len(HEAD) - 5))
    found, halves = entry.margins, entry.halves
    figures = (
        ("sensitivity_peak", found.sensitivity_peak, ""),
        ("gain_margin_db", found.gain_margin_db, "dB"),
        ("phase_margin_deg", found.phase_margin_deg, "deg"),
        ("rise_s", entry.step.rise_s, "s"),
        ("settling_2_s", entry.step.settling_2_s, "s"),
        ("overshoot_percent", entry.step.overshoot_percent, "%"),
        ("iae", entry.step.iae, ""),
        ("load_peak", entry.load.peak, ""),
        ("load_iae", entry.load.iae, ""),
        ("noise_gain", entry.noise_gain, ""),
    )
    return (entry.rule, *gains, *(no_finer(value, halves.get(name, 0.0), unit) for name, value, unit in figures))


def contest_document(entries: Sequence[Entry]) -> list[Mapping[str, object]]:
    """One object a rule."""
    return [_document(entry) for entry in entries]


def _document(entry: Entry) -> dict[str, object]:
    if entry.design is None:
        return {"rule": entry.rule, "refused": entry.refused}
    return {
        "rule": entry.rule,
        "gains": dict(entry.design.gains),
        "margins": None if entry.margins is None else fields_document(entry.margins),
        "step": None if entry.step is None else fields_document(entry.step),
        "load": None if entry.load is None else fields_document(entry.load),
        "noise_gain": finite(entry.noise_gain),
        "ci95_half": {name: finite(half) for name, half in entry.halves.items()},
    }


def _csv(entries: Sequence[Entry]) -> str:
    """Write the table in full precision; empty cells where a rule gives nothing."""
    stream = io.StringIO()
    rows = csv.writer(stream, lineterminator="\n")
    rows.writerow(COLUMNS)
    for entry in entries:
        made, margins, step, load = entry.design, entry.margins, entry.step, entry.load
        rows.writerow(
            [
                entry.rule,
                *([made.gains[name] for name in ("kp", "ki", "kd")] if made else [""] * 3),
                *([getattr(margins, name) for name in MARGINS] if margins else [""] * 3),
                *([step.rise_s, step.settling_2_s, step.overshoot_percent, step.iae] if step else [""] * 4),
                *([load.peak, load.recovery_s, load.iae, entry.noise_gain] if load else [""] * 4),
                entry.refused,
            ]
        )
    return stream.getvalue()

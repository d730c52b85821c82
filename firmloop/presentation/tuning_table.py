"""Tell in one table what every tuning rule makes of a plant."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from firmloop.console import table
from firmloop.presentation.documents import fields_document, finite
from firmloop.presentation.words import NO_LIMIT, NOT_REACHED, UNREACHED, no_finer, short_of

if TYPE_CHECKING:
    from firmloop.design.analysis.contest import Entry

HEAD = (
    *("", "kp", "ki", "kd", "Ms", "gain margin", "phase margin", "rise", "settling 2 %", "overshoot"),
    *("step IAE", "load peak", "load IAE", "noise gain"),
)
MARGINS = ("sensitivity_peak", "gain_margin_db", "phase_margin_deg")
COLUMNS = (
    *("rule", "kp", "ki", "kd", "ms", "gain_margin_dB", "phase_margin_deg", "rise_s", "settling_2_s"),
    *("overshoot_percent", "step_iae", "load_peak", "load_recovery_s", "load_iae", "noise_gain", "refused"),
)


def about_contest(entries: Sequence[Entry]) -> list[str]:
    """One line a rule; below, what the rules that do not fit say."""
    refused = [f"  {entry.rule}: {entry.refused}" for entry in entries if entry.refused]
    rows = [HEAD, *contest_rows(entries)]
    lines = ["tuning rules on one plant", *table(rows), *contest_notes(entries)]
    return lines + (["not for this plant:", *refused] if refused else [])


def contest_notes(entries: Sequence[Entry]) -> list[str]:
    """Tell what the figures of the table are of, and what they are not."""
    note = ["  note: no more digits than the plant's 95 % intervals leave; tuning.json says what they are worth"]
    told = [
        f"  note: every step here is about output {about:.4g}, the middle of its range, and free to go both ways; the "
        "step whose figures design prints by themselves begins at rest with output 0"
        for about in sorted({entry.about for entry in entries} - {0.0})
    ]
    ends = [entry.unreached for entry in entries if entry.unreached is not None]
    held = [
        f"  note: {UNREACHED}: {short}; rise, settling, overshoot and step IAE are of what comes, whatever the gains"
        for short in dict.fromkeys(short_of(each.end, each.size, each.unit) for each in ends)
    ]
    return [*told, *held, *(note if any(entry.halves for entry in entries) else [])]


def contest_rows(entries: Sequence[Entry]) -> list[tuple[str, ...]]:
    """One row a rule, under HEAD; none for a rule that does not fit."""
    return [_row(entry) for entry in entries if not entry.refused]


def _row(entry: Entry) -> tuple[str, ...]:
    assert entry.design is not None and entry.margins is not None
    gains = tuple(f"{entry.design.gains[name] + 0.0:.4g}" for name in ("kp", "ki", "kd"))
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
    written = (
        no_finer(value, halves.get(name, 0.0), unit, NO_LIMIT if name in MARGINS else NOT_REACHED)
        for name, value, unit in figures
    )
    return (entry.rule, *gains, *written)


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
        "unreached": None if entry.unreached is None else fields_document(entry.unreached),
        "noise_gain": finite(entry.noise_gain),
        "ci95_half": {name: finite(half) for name, half in entry.halves.items()},
    }


def contest_csv(entries: Sequence[Entry]) -> str:
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

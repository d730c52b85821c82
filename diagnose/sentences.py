"""Say a finding in a few sentences, with figures and units."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

from firmloop.diagnose.discrepancy.fit import Shape
from firmloop.diagnose.finding import Finding, Shift
from firmloop.diagnose.policy import FAILED_RATIO, FAILED_RMS, HELD_SHARE, THRESHOLD
from firmloop.diagnose.search.found import Search
from firmloop.identify.fitting.own_values import OwnValue
from firmloop.identify.normal import NORMAL_95


def paragraph(finding: Finding, search: Search, shape: Shape | None) -> tuple[str, ...]:
    """Say it in a few sentences."""
    said: list[str] = []
    train = finding.train
    if finding.verdict == "no_mismatch" and train.refit is None:
        said.append(
            "No mismatch was found, but nothing could be compared: simulations diverge from the recorded input, as "
            "those of an unstable plant do without its controller. Cut the recordings into stretches that a simulation "
            "follows."
        )
    elif finding.verdict == "no_mismatch":
        said.append(
            f"No mismatch: no effect of the library explains more than noise would (BIC threshold {THRESHOLD:g})."
        )
    elif finding.verdict == "unknown_physics":
        follows = f" It follows {shape.coordinate} in the {shape.balance} balance." if shape is not None else ""
        said.append(f"Something is missing that no effect of the library explains.{follows}")
    elif finding.verdict == "ambiguous":
        names = ", ".join(each.name for each in finding.effects)
        said.append(f"More than one explanation stands: {names}.")
        for each in sorted(finding.effects, key=lambda one: one.probability):  # the surest is not in question
            term = search.problem.term(each.name)
            if term is not None:
                said.append(f"To tell {each.name} apart: {term.effect.experiment.rstrip('.')}.")
                break
    said += [f"{each.name} ({100.0 * each.probability:.0f} %): {each.says}" for each in finding.effects]
    if finding.effects:
        moved = [shift for shift in finding.shifts if shift.after > 0.0 and _moved(shift) > 0.05]
        for shift in sorted(moved, key=lambda one: -_moved(one))[:2]:
            said.append(
                f"A refit without it would put {shift.name} at {shift.refit / shift.after:.2f} times its value "
                f"({shift.refit:.4g} instead of {shift.after:.4g} {shift.unit})."
            )
    for name in dict.fromkeys(one.parameter.name for one in finding.per_recording):
        own = [one for one in finding.per_recording if one.parameter.name == name]
        said.append(f"Each recording has its own {name}: {', '.join(map(_own, own))} {own[0].parameter.unit or '1'}.")
    figures = [("train", train)] + ([("test", finding.test)] if finding.test else [])
    for role, ratio in figures:
        steps = [
            f"{name} {value:.2f}"
            for name, value in (("as given", ratio.before), ("refitted", ratio.refit), ("explained", ratio.after))
            if value is not None
        ]
        said.append(f"Residual over noise, {role}: {', '.join(steps) or 'none, simulations diverge'}.")
    if finding.location is not None:
        said.append(f"Seen where {finding.location.evidence}.")
    for other in finding.alternatives[:2]:
        # Of what the library knows it may be the likeliest by far, and yet it is not what is missing.
        chance = "" if finding.verdict == "unknown_physics" else f" ({100.0 * other.probability:.0f} %)"
        said.append(f"Next candidate: {other.name}{chance}; to tell apart: {other.tell_apart_by}")
    said += [f"Note: {note}." for note in finding.notes[:6]]
    if finding.untestable:
        said.append(f"Cannot be tested with these recordings: {', '.join(sorted(finding.untestable))}.")
    return tuple(said)


def _own(one: OwnValue) -> str:
    known = one.parameter
    reach = "" if known.deviation is None else f" ± {NORMAL_95 * known.deviation:.2g}"
    return f"{Path(one.source).name} {known.value:.4g}{reach}"


def with_doubt(finding: Finding) -> Finding:
    """Return the finding, with a note where train and test contradict each other."""
    test, train = finding.test, finding.train
    if test is None or test.after is None or train.after is None:
        return finding
    if test.after < FAILED_RMS or test.after < FAILED_RATIO * train.after:
        return finding
    if test.refit is not None and test.after < HELD_SHARE * test.refit:
        return finding
    said = (
        f"the test recordings do not follow from what the train recordings tell: {test.after:.3g} times the noise is "
        f"left there, {train.after:.3g} times here; another machine, unit or regime, so check that all are of one plant"
    )
    return replace(finding, notes=(*finding.notes, said), says=(*finding.says, f"Note: {said}."))


def _moved(shift: Shift) -> float:
    """Return how far the refit alone puts a parameter from where it stands beside the effects, as a logarithm."""
    return abs(math.log(max(shift.refit, 1e-300) / shift.after))

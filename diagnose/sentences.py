"""Say a finding in a few sentences, with figures and units."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from firmloop.diagnose.discrepancy.fit import Shape
from firmloop.diagnose.finding import Finding, Named, Shift
from firmloop.diagnose.model.candidate import Candidate
from firmloop.diagnose.plant_words import balance_told, in_its_words
from firmloop.diagnose.policy import (
    CHANCE_DRAWS,
    FAILED_RMS,
    HELD_SHARE,
    MOST_TIMES,
    MOTION_MISSED,
    RIVALS_DRIVE,
    STILL_MISSING,
    THRESHOLD,
)
from firmloop.diagnose.search.found import Search
from firmloop.identify.fitting.own_values import OwnValue
from firmloop.identify.normal import NORMAL_95
from firmloop.identify.plants.attach import chosen_place
from firmloop.identify.plants.plant import EffectUse, Plant


def paragraph(
    finding: Finding, search: Search, shape: Shape | None, others: Sequence[Candidate] = ()
) -> tuple[str, ...]:
    """Say it in a few sentences; `others` are the explanations that stand beside the best."""
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
        follows = (
            f" It follows {shape.coordinate}, in the {balance_told(search.problem.plant, shape.balance)}."
            if shape is not None
            else ""
        )
        said.append(f"Something is missing that no effect of the library explains.{follows}")
    elif finding.verdict == "ambiguous":
        common = set.intersection(*({t.effect.name for t in each.fitted.terms} for each in (search.best, *others)))
        told = [(each, _placed(search.problem.plant, each)) for each in finding.effects]
        names = [", ".join(name for e, name in told if (e.name in common) == part) for part in (True, False)]
        said.append(
            f"More than one explanation stands: all hold {names[0]}, and are not told apart beside it: {names[1]}."
            if all(names)
            else f"More than one explanation stands: {', '.join(filter(None, names))}."
        )
        for each in sorted(finding.effects, key=lambda one: one.probability):  # the surest is not in question
            term = search.problem.term(each.name)
            if term is not None:
                test = in_its_words(search.problem.plant, term.effect.experiment.rstrip("."))
                said.append(f"To tell {each.name} apart: {test}.")
                break
    said += [each.told() for each in finding.effects]
    if finding.effects:
        moved = [shift for shift in finding.shifts if shift.after > 0.0 and _moved(shift) > 0.05]
        gone = "it" if len(finding.effects) == 1 else "them"
        for shift in sorted(moved, key=lambda one: -_moved(one))[:2]:
            unit = f" {shift.unit}" if shift.unit else ""
            said.append(
                f"A refit without {gone} would put {shift.name} at {_times(shift.refit / shift.after)} times its value "
                f"({shift.refit:.4g} instead of {shift.after:.4g}{unit})."
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


def _times(factor: float) -> str:
    """Write a factor down with three digits, as long as they mean something."""
    if abs(factor) > MOST_TIMES:
        return f"more than {MOST_TIMES:g}" if factor > 0.0 else f"less than -{MOST_TIMES:g}"
    return f"{factor:#.3g}".rstrip(".")


def _placed(plant: Plant, each: Named) -> str:
    """Name an effect, with its place where it could act at another."""
    place = chosen_place(plant, EffectUse(each.name, each.output, {}))
    return each.name if place is None else f"{each.name} at {each.at}"


def _own(one: OwnValue) -> str:
    known = one.parameter
    reach = "" if known.deviation is None else f" ± {NORMAL_95 * known.deviation:.2g}"
    return f"{Path(one.source).name} {known.value:.4g}{reach}"


def measured_too(
    plant: Plant, finding: Finding, missed: float, own: tuple[tuple[str, ...], float], sensors: bool
) -> Finding:
    """Return the finding with what it says of chance, of what is still missing, and of what was left out of the fit.

    `missed` is what simulations miss, as a share of what the output moves that they follow worst; `own` what
    would differ from run to run, and the share of the rms that it leaves; `sensors` where all that is left is likelier
    noise of sensors than a disturbance, and no physics without a name.
    """
    if sensors:
        rest = _about_sensors(finding)
    else:
        rest = [*_about_rest(finding), *_about_disturbance(plant, finding, missed)]
    said = [
        *_about_lags(plant, finding),
        *_about_chance(finding),
        *rest,
        *_about_runs(*own),
        *_about_left_out(finding),
    ]
    return replace(finding, says=(*finding.says, *said))


def _about_lags(plant: Plant, finding: Finding) -> list[str]:
    """Say what else may lag where one output is all that is read."""
    if len(plant.outputs) > 1 or not any(each.name == "sensor_lag" for each in finding.effects):
        return []
    return ["With one reading alone, what lags may as well be the actuator, or a second store of the plant."]


def _about_chance(finding: Finding) -> list[str]:
    found = finding.evidence
    if found is None or found.p_value is None or not finding.effects:
        return []
    least = "at most " if found.p_value * (CHANCE_DRAWS + 1.0) <= 1.0 else ""
    return [
        f"{found.criterion} drops by {found.gain:.4g}; among {found.library} terms chance would do so with a "
        f"probability of {least}{found.p_value:.2g}."
    ]


def _about_rest(finding: Finding) -> list[str]:
    """Say that more is left than the sensors' noise: where an explanation stands, that it is not the whole of it."""
    left = finding.train.after
    if left is None or left < STILL_MISSING:
        return []
    if not finding.effects:
        return [
            f"Simulations miss by {left:.3g} times the sensors' noise. Run the same input twice: what repeats is "
            "physics that has no name here, what does not is a disturbance."
        ]
    return [
        f"That is not the whole of it: simulations still miss by {left:.3g} times the sensors' noise, which another "
        "effect, or a disturbance, makes."
    ]


def _about_sensors(finding: Finding) -> list[str]:
    """Say that sensors with a memory make what is left, where that is more than their white noise."""
    left = finding.train.after
    if left is None or left < STILL_MISSING:
        return []
    return [
        f"Simulations still miss by {left:.3g} times the sensors' white noise: likelier noise of a sensor with a "
        "memory, as a filter's, than a disturbance of the machine."
    ]


def _about_runs(names: Sequence[str], share: float) -> list[str]:
    """Ask about what brings simulations far nearer where each recording has its own."""
    if not names:
        return []
    listed = ", ".join(f'"{name}"' for name in names)
    return [
        f"Does something differ from run to run? With its own {' and '.join(names)} each recording is simulated to "
        f"{share:.2g} of the rms; if so, say so in [recordings]: per_recording = [{listed}]."
    ]


def _about_disturbance(plant: Plant, finding: Finding, missed: float) -> list[str]:
    """Say how large a disturbance of each balance makes what is left, and where that is too much to be noise."""
    left, said = finding.train.after, []
    silent = finding.verdict == "no_mismatch" and missed < MOTION_MISSED
    for name, each in finding.disturbance.items():
        rivals = each.share is not None and each.share > RIVALS_DRIVE
        if (left is None or left < STILL_MISSING) and (silent or not rivals):
            continue
        size = f"{each.rms:.3g}{f' {each.unit}' if each.unit else ''} rms"
        share = "" if each.share is None else f", {_percent(each.share)} of the drive"
        meant = ""
        if rivals:
            meant = (
                "; much for noise: run the same input twice, for what repeats is physics without a name here"
                if silent
                else ": that is not noise"
            )
        said.append(
            f"Left beside the white noise of the sensors: as much as a disturbance of {size} in the "
            f"{balance_told(plant, name)} makes{share}{meant}."
        )
    return said


def _percent(share: float) -> str:
    return f"{100.0 * share:{'.0f' if share > 0.1 else '.2g'}} %"


def _about_left_out(finding: Finding) -> list[str]:
    told = [("before", "as given"), ("refit", "refitted"), *([("after", "explained")] if finding.effects else [])]
    crossed = finding.simulation_rms.get("cross", {})
    figures = [
        f"{name} by {', '.join(f'{rms[key]:.3g} {word}' for key, word in told if key in rms)}"
        for name, rms in crossed.items()
    ]
    return [f"Of rows left out of the fit simulations miss (rms) {'; '.join(figures)}."] if figures else []


def with_doubt(finding: Finding) -> Finding:
    """Return the finding, with a note where train and test contradict each other."""
    test, train = finding.test, finding.train
    if test is None or test.after is None or train.after is None:
        return finding
    if test.after < FAILED_RMS * max(train.after, 1.0):
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

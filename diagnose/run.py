"""Diagnose a plant: preflight, search, shape of what is left, verdict, and a plant that does no harm."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from firmloop.diagnose.completion import begun_anew, completed
from firmloop.diagnose.data.channels import check_sound
from firmloop.diagnose.data.checks import Preflight, preflight
from firmloop.diagnose.data.prepare import Apart, prepared, two_machines
from firmloop.diagnose.discrepancy.disturbance import disturbances
from firmloop.diagnose.discrepancy.fit import Shape, best_shape
from firmloop.diagnose.finding import Finding
from firmloop.diagnose.given_values import HeldValue, against_given, beside_held
from firmloop.diagnose.model.candidate import Candidate, rated, residual_sizes, rms_of
from firmloop.diagnose.model.disturbed_plant import sensors_remember
from firmloop.diagnose.model.fit import fit_starts
from firmloop.diagnose.model.hypothesis import make_problem, outputs_of
from firmloop.diagnose.model.slopes import residual_of
from firmloop.diagnose.policy import HOLD_GAIN
from firmloop.diagnose.search.anew import Settings
from firmloop.diagnose.search.chance import evidence_of
from firmloop.diagnose.search.exchange import twins
from firmloop.diagnose.search.found import Progress, Search
from firmloop.diagnose.search.harmless import (
    EVERYWHERE,
    FIRST,
    Simulations,
    harmed,
    held,
    plain_refit,
    simulated_figures,
)
from firmloop.diagnose.search.held_out import Kept, holding, told
from firmloop.diagnose.search.improved import improved_plant
from firmloop.diagnose.search.run_to_run import differing
from firmloop.diagnose.search.stepwise import search
from firmloop.diagnose.search.wrap_range import regauged
from firmloop.diagnose.sentences import measured_too
from firmloop.diagnose.verdict import judge, spoiled
from firmloop.diagnose.withheld import withheld
from firmloop.identify.error import IdentifyError
from firmloop.identify.fitting.noise import oversized, white
from firmloop.identify.plants.plant import Plant
from firmloop.identify.recordings.recording import Recording

SimulationRms = Mapping[str, Mapping[str, Mapping[str, float]]]  # by role, output, plant


@dataclass(frozen=True, slots=True)
class Diagnosis:
    """A finding with what it rests on; `plant` is the improved one, `shape` what has no name, where that is found."""

    finding: Finding
    search: Search
    shape: Shape | None
    plant: Plant

    @property
    def hold(self) -> str:
        """What the input did between rows."""
        return self.search.problem.train[0].hold

    @property
    def shown(self) -> Candidate:
        """The explanation that the finding stands for."""
        explained = self.finding.verdict in ("explained", "ambiguous")
        return self.search.best if explained else self.search.nominal


@dataclass(frozen=True, slots=True)
class _Found:
    search: Search
    checks: Preflight
    shape: Shape | None
    beside: HeldValue | None


def diagnose(plant: Plant, train: Sequence[Recording], test: Sequence[Recording], progress: Progress) -> Diagnosis:
    """Say where the plant and its recordings differ and why; IdentifyError where the recordings cannot tell.

    The test recordings take part in no choice: they are simulated at the very end. Where an explanation simulates one
    of them worse than the plain refit does, the plant stays the refit, whatever the finding says of train.
    """
    progress(0.02, "checking the recordings")
    check_sound(plant, train, test)
    given = train[0].hold
    seen, unseen = prepared(plant, train, test)
    apart = two_machines(plant, train)
    preflight(plant, seen, unseen)  # a test recording that cannot be of this plant is refused as well
    made = _explained(plant, seen, progress)
    if seen[0].hold != given and any(term.effect.late for term in made.search.best.fitted.terms):
        # Half a row of delay may have looked like another hold to the nominal plant alone.
        as_given = held(seen, given)
        other = _explained(plant, as_given, progress)
        scores = [rated(each.search.problem, each.search.best.fitted).score for each in (other, made)]
        if scores[0] < scores[1] + HOLD_GAIN:
            made, unseen = other, held(unseen, given)
    hold = made.search.problem.train[0].hold
    if hold != given:
        made = replace(made, checks=replace(made.checks, notes=(*made.checks.notes, _another_hold(hold))))
    whole, later = held(train, hold), held(test, hold)
    refit = plain_refit(made.search, plant, whole)
    progress(0.9, "simulating what is left out of the fit")
    plain = Simulations(refit, whole)
    made, (kept, crossed, safe) = _held(made, plain, progress)
    problem = make_problem(plant, seen, unseen, made.checks.floors) if unseen else made.search.problem
    found = replace(made.search if kept is None else kept, problem=replace(made.search.problem, test=problem.test))
    same = kept is None or kept.best.fitted.terms == made.search.best.fitted.terms
    shape = made.shape if same else best_shape(found, found.best)
    finding, unnamed = judge(found, made.checks, shape)
    finding = beside_held(finding, made.beside)
    explained = finding.verdict in ("explained", "ambiguous")
    if explained and kept is None:
        finding, explained = spoiled(finding), False
        if not told(crossed) and not oversized(found.nominal.noises):
            # What foresees nothing and is no larger than noise may be is noise.
            found = replace(found, best=found.nominal, rounds=(), gains=())
            finding, unnamed = judge(found, made.checks, None)
    written = improved_plant(found, found.best) if explained else refit
    if apart is not None and not (explained and _one(found, apart)):
        raise IdentifyError(apart.says)
    freely = {"train": {"before": Simulations(plant, whole), "refit": plain, "after": Simulations(written, whole)}}
    if later:
        freely["test"] = {name: Simulations(each.plant, later) for name, each in freely["train"].items()}
    if explained:
        # What was kept as safe harms no simulation of train that begins where all its readings say.
        begins = {"train": FIRST if safe else EVERYWHERE, "test": EVERYWHERE}
        worse = {role: harmed(each["after"], each["refit"], begins[role]) for role, each in freely.items()}
        if any(worse.values()):
            finding, written = withheld(finding, worse), refit
    if written is refit:
        freely = {role: {**each, "after": each["refit"]} for role, each in freely.items()}
    figures = simulated_figures(freely)
    if crossed:
        figures = {**figures, "cross": {name: _crossed(each, explained) for name, each in crossed.items()}}
    shown = None if explained else refit
    own = differing(freely["train"]["after"], refit=not explained and finding.verdict == "unknown_physics")
    finding = _measured(finding, found, shown, shape, figures, own)
    return Diagnosis(finding, found, unnamed if not explained else None, written)


def _held(made: _Found, plain: Simulations, progress: Progress) -> tuple[_Found, Kept]:
    """Return what was found and what of it holds; where nothing does, what a search by simulation error finds."""
    kept, engine = holding(made.search, plain), made.search.problem.engine
    if kept.search is not None:
        return made, kept
    before = Settings.of(engine)
    if (anew := begun_anew(made.search, progress)) is not None:
        again = _beside(*anew, made.checks)
        other = holding(again.search, plain)
        if other.search is not None:
            return again, other
    before.restore(engine)
    return made, kept


def _one(found: Search, apart: Apart) -> bool:
    """Tell whether the best of a search makes one machine of what seemed to be two."""
    outputs = [outputs_of(found.problem, recording) for recording in found.problem.train]
    return apart.made_one(outputs, found.best.fitted.residuals)


def _another_hold(hold: str) -> str:
    """Say that the input is taken to have moved between its rows, where the project has it held."""
    path = "a straight line" if hold == "linear" else "the smooth curve of a band-limited signal"
    return (
        f"between its rows the input is taken to follow {path}, which explains the recordings clearly better than "
        f'steps do; the written project has hold = "{hold}" in [recordings]'
    )


def _measured(
    finding: Finding,
    found: Search,
    refit: Plant | None,
    shape: Shape | None,
    figures: SimulationRms,
    own: tuple[tuple[str, ...], float],
) -> Finding:
    """Return the finding with how large is what is still missing, how sure it is, and how it does where left out.

    `refit` is the plant that stands for the finding where no explanation does, `shape` what has no name beside it;
    `figures` are those of free simulations, `own` what differs from run to run, see `differing`.
    """
    problem, sizes = found.problem, residual_sizes(found.best.fitted.residuals)
    known = {} if refit is None else {p.name: p.value for p in refit.parameters}
    values = {**(found.best if refit is None else found.nominal).fitted.point.values, **known}
    point = fit_starts(problem, problem.train, values, [white(size) for size in sizes])
    residuals = [residual_of(problem, recording, point, k) for k, recording in enumerate(problem.train)]
    moves = np.std(np.concatenate([outputs_of(problem, recording) for recording in problem.train]), axis=0)
    missed = float(np.max(rms_of(residuals) / np.maximum(moves, 1e-300)))
    evidence = evidence_of(found)
    if finding.verdict == "unknown_physics" and shape is not None:  # whose chance nobody has drawn
        evidence = replace(evidence, gain=evidence.gain + shape.gain, p_value=None)
    return measured_too(
        problem.plant,
        replace(
            finding,
            simulation_rms=figures,
            disturbance=disturbances(
                problem.plant.valued(values), problem.train, residuals, list(finding.noise.values())
            ),
            evidence=evidence,
        ),
        missed,
        own,
        finding.verdict != "unknown_physics" and sensors_remember(problem, values, residuals),
    )


def _crossed(figures: Mapping[str, float], explained: bool) -> dict[str, float]:
    """Return the figures of what was left out; where nothing is explained the written plant is the refit."""
    return dict(figures) if explained or "refit" not in figures else {**figures, "after": figures["refit"]}


def _explained(plant: Plant, train: Sequence[Recording], progress: Progress) -> _Found:
    checks = preflight(plant, train, ())
    problem = make_problem(plant, train, (), checks.floors)
    found = search(problem, progress)
    again = regauged(found, train, ())
    if again is not None:  # a range a little off is a step at every turn, which another effect may soak up
        found = min(search(again, progress), found, key=lambda each: each.best.score)
    found, shape = completed(found, progress)
    again = regauged(found, train, ())
    if again is not None:
        other, rest = completed(search(again, progress), progress)
        if other.best.score < found.best.score:
            found, shape = other, rest
    return _beside(found, shape, checks)


def _beside(found: Search, shape: Shape | None, checks: Preflight) -> _Found:
    """Return what was found with what may stand beside it: twins, and values that the project holds."""
    found = replace(found, rounds=(*found.rounds, twins(found.problem, found.best, found.rounds)))
    sure, notes, held_value = against_given(found)
    if sure.best is not found.best:
        shape = best_shape(sure, sure.best)
    return _Found(sure, replace(checks, notes=(*checks.notes, *notes)), shape, held_value)

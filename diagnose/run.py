"""Diagnose a plant: preflight, search, shape of what is left, verdict, and a plant that does no harm."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from firmloop.diagnose.finding import Finding
from firmloop.diagnose.further import completed
from firmloop.diagnose.harmless import (
    by_simulation_error,
    harmless,
    held,
    plain_refit,
    same_function,
    simulated_figures,
)
from firmloop.diagnose.held import HOLD_WORTH
from firmloop.diagnose.hypothesis import make_scene
from firmloop.diagnose.improved import improved_plant
from firmloop.diagnose.judge import judge, spoiled
from firmloop.diagnose.plain import independent
from firmloop.diagnose.preflight import Preflight, preflight
from firmloop.diagnose.prepare import prepared
from firmloop.diagnose.rank import Progress, Search, search
from firmloop.diagnose.refit import ended
from firmloop.diagnose.regauge import regauged
from firmloop.diagnose.rival import Rival, believable, rated
from firmloop.diagnose.shape import Shape
from firmloop.diagnose.sound import check_sound
from firmloop.identify.plants.plant import Plant
from firmloop.identify.recordings.recording import Recording


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
        return self.search.scene.train[0].hold

    @property
    def shown(self) -> Rival:
        """The explanation that the finding stands for."""
        explained = self.finding.verdict in ("explained", "ambiguous")
        return self.search.best if explained else self.search.nominal


@dataclass(frozen=True, slots=True)
class _Found:
    search: Search
    checks: Preflight
    shape: Shape | None


def diagnose(plant: Plant, train: Sequence[Recording], test: Sequence[Recording], progress: Progress) -> Diagnosis:
    """Say where the plant and its recordings differ and why; IdentifyError where the recordings cannot tell.

    The test recordings take part in no choice: they are simulated at the very end.
    """
    progress(0.02, "checking the recordings")
    check_sound(plant, (*train, *test))
    given = train[0].hold
    seen, unseen = prepared(plant, train, test)
    preflight(plant, seen, unseen)  # a test recording that cannot be of this plant is refused as well
    made = _explained(plant, seen, progress)
    if seen[0].hold != given and any(cause.effect.late for cause in made.search.best.fitted.causes):
        # Half a row of delay may have looked like another hold to the nominal plant alone.
        as_given = held(seen, given)
        other = _explained(plant, as_given, progress)
        scores = [rated(each.search.scene, each.search.best.fitted).score for each in (other, made)]
        if scores[0] < scores[1] + HOLD_WORTH:
            made, unseen = other, held(unseen, given)
    hold = made.search.scene.train[0].hold
    whole, later = held(train, hold), held(test, hold)
    refit = plain_refit(plant, whole, improved_plant(made.search, made.search.nominal))
    safe = _harmless(made.search, refit, whole)
    scene = make_scene(plant, seen, unseen, made.checks.floors) if unseen else made.search.scene
    found = replace(made.search if safe is None else safe, scene=replace(made.search.scene, test=scene.test))
    finding, unnamed = judge(found, made.checks, made.shape)
    explained = finding.verdict in ("explained", "ambiguous")
    if explained and safe is None:
        finding, explained = spoiled(finding), False
    written = improved_plant(found, found.best) if explained else refit
    plants = {"before": plant, "refit": refit, "after": written}
    figures = simulated_figures(plants, {"train": whole, "test": later})
    finding = replace(finding, simulation_rms=figures)
    return Diagnosis(finding, found, unnamed if not explained else None, written)


def _harmless(found: Search, refit: Plant, recordings: Sequence[Recording]) -> Search | None:
    """Return the search, its best explanation with values that harm no simulation; None where there are none.

    As found, or else by plain simulation error, beside the names that simulate just as well.
    """
    if not found.best.fitted.causes or harmless(improved_plant(found, found.best), refit, recordings):
        return found
    scene = found.scene
    fitted = by_simulation_error(scene, found.best.fitted)
    fitted = ended(scene, fitted, independent(fitted.residuals))
    best = replace(found.best, fitted=fitted, noises=independent(fitted.residuals))
    other = replace(found, best=best)
    if not believable(fitted) or not harmless(improved_plant(other, best), refit, recordings):
        return None
    same = tuple(Rival(each, independent(each.residuals), best.score) for each in same_function(scene, fitted))
    return replace(other, rounds=(*other.rounds, same))


def _explained(plant: Plant, train: Sequence[Recording], progress: Progress) -> _Found:
    checks = preflight(plant, train, ())
    scene = make_scene(plant, train, (), checks.floors)
    found = search(scene, progress)
    again = regauged(found, train, ())
    if again is not None:  # a range a little off is a step at every turn, which another effect may soak up
        found = min(search(again, progress), found, key=lambda each: each.best.score)
    found, shape = completed(found, progress)
    again = regauged(found, train, ())
    if again is not None:
        other, rest = completed(search(again, progress), progress)
        if other.best.score < found.best.score:
            found, shape = other, rest
    return _Found(found, checks, shape)

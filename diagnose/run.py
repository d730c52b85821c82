"""Diagnose a plant: preflight, search, shape of what is left, verdict."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from firmloop.diagnose.finding import Finding
from firmloop.diagnose.further import completed
from firmloop.diagnose.held import HOLD_WORTH
from firmloop.diagnose.hypothesis import make_scene
from firmloop.diagnose.judge import improved_plant, judge
from firmloop.diagnose.preflight import Preflight, preflight
from firmloop.diagnose.prepare import prepared
from firmloop.diagnose.rank import Progress, Search, search
from firmloop.diagnose.regauge import regauged
from firmloop.diagnose.rival import Rival, rated
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


def diagnose(plant: Plant, train: Sequence[Recording], test: Sequence[Recording], progress: Progress) -> Diagnosis:
    """Say where the plant and its recordings differ and why; IdentifyError where the recordings cannot tell."""
    progress(0.02, "checking the recordings")
    check_sound(plant, (*train, *test))
    given = train[0].hold
    train, test = prepared(plant, train, test)
    found, checks, shape = _explained(plant, train, test, progress)
    if train[0].hold != given and any(cause.effect.late for cause in found.best.fitted.causes):
        # Half a row of delay may have looked like another hold to the nominal plant alone.
        held, unseen = ([replace(each, hold=given) for each in part] for part in (train, test))
        other = _explained(plant, held, unseen, progress)
        if rated(other[0].scene, other[0].best.fitted).score < rated(found.scene, found.best.fitted).score + HOLD_WORTH:
            found, checks, shape = other
    finding, unnamed = judge(found, checks, shape)
    shown = found.best if finding.verdict in ("explained", "ambiguous") else found.nominal
    return Diagnosis(finding, found, unnamed, improved_plant(found, shown))


def _explained(
    plant: Plant, train: Sequence[Recording], test: Sequence[Recording], progress: Progress
) -> tuple[Search, Preflight, Shape | None]:
    checks = preflight(plant, train, test)
    scene = make_scene(plant, train, test, checks.floors)
    found = search(scene, progress)
    again = regauged(found, train, test)
    if again is not None:  # a range a little off is a step at every turn, which another effect may soak up
        found = min(search(again, progress), found, key=lambda each: each.best.score)
    found, shape = completed(found, progress)
    again = regauged(found, train, test)
    if again is not None:
        other, rest = completed(search(again, progress), progress)
        if other.best.score < found.best.score:
            found, shape = other, rest
    return found, checks, shape

"""Diagnose a plant: preflight, search, shape of what is left, verdict."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from diagnose.finding import Finding
from diagnose.further import completed
from diagnose.hypothesis import make_scene
from diagnose.judge import improved_plant, judge
from diagnose.preflight import preflight
from diagnose.prepare import prepared
from diagnose.rank import Progress, Search, search
from diagnose.rival import Rival
from diagnose.shape import Shape
from diagnose.sound import check_sound
from identify.plant import Plant
from identify.recording import Recording


@dataclass(frozen=True, slots=True)
class Diagnosis:
    """A finding with what it rests on; `plant` is the improved one."""

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
    train, test = prepared(plant, train, test)
    checks = preflight(plant, train, test)
    scene = make_scene(plant, train, test, checks.floors)
    found, shape = completed(search(scene, progress), progress)
    finding = judge(found, checks, shape)
    shown = found.best if finding.verdict in ("explained", "ambiguous") else found.nominal
    return Diagnosis(finding, found, shape, improved_plant(found, shown))

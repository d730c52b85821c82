"""A second inertia is taken from the nominal one, and goes back to it with the effect that had it."""

from __future__ import annotations

from pathlib import Path

import pytest

from firmloop.diagnose.hypothesis import Cause, Point, Scene, entered, first_point
from firmloop.diagnose.refit import Fitted, fit
from firmloop.diagnose.rival import extended, without
from firmloop.diagnose.swap import exchanged
from firmloop.identify.fitting.noise import white
from tests.diagnose.cases import drawn, scene_of

SEED = 891157  # a stage of one mass
LOAD = 7.0


@pytest.fixture
def scene(tmp_path: Path) -> Scene:
    return scene_of(drawn(tmp_path, SEED))


def cause_of(scene: Scene, name: str) -> Cause:
    found = scene.cause(name)
    assert found is not None
    return found


def loaded(scene: Scene, cause: Cause, load: float) -> dict[str, float]:
    """Return the first start of a cause with a second mass of `load` kg."""
    return {**scene.starts[cause.label][0], f"{cause.label}.load_mass_kg": load}


def coupled(scene: Scene) -> tuple[Fitted, float]:
    """Return the stage with a load on a coupling, and its mass before."""
    coupling, begin = cause_of(scene, "flexible_coupling"), first_point(scene, scene.train)
    values = entered(begin.values, coupling, loaded(scene, coupling, LOAD))
    sizes = [white(1.0)] * len(scene.plant.outputs)
    made = fit(scene, scene.train, (coupling,), Point(values, begin.starts), sizes, 0)
    assert made.point.values["mass_kg"] == pytest.approx(begin.values["mass_kg"] - LOAD, rel=1e-12)
    return made, begin.values["mass_kg"]


def test_a_load_that_is_left_out_is_mass_again(scene: Scene) -> None:
    base, mass = coupled(scene)
    causes, point = without(base, *base.causes)
    assert not causes
    assert point.values["mass_kg"] == pytest.approx(mass, rel=1e-12)


def test_a_gap_that_contains_a_coupling_adds_no_mass_and_loses_none(scene: Scene) -> None:
    base, mass = coupled(scene)
    gap = cause_of(scene, "backlash")
    causes, point = extended(base, gap, loaded(scene, gap, LOAD / 2))
    assert causes == (gap,)
    assert point.values["mass_kg"] + point.values[f"{gap.label}.load_mass_kg"] == pytest.approx(mass, rel=1e-12)


def test_a_gap_with_the_same_load_leaves_the_mass_exactly_as_it_was(scene: Scene) -> None:
    base, _ = coupled(scene)
    gap = cause_of(scene, "backlash")
    _, point = exchanged(base, base.causes[0], gap, loaded(scene, gap, LOAD))
    assert point.values["mass_kg"] == base.point.values["mass_kg"]

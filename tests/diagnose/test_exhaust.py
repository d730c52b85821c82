"""A cause that a screen has missed is found before anything is called unknown."""

from __future__ import annotations

from pathlib import Path

import pytest

from firmloop.diagnose.exhaust import exhausted
from firmloop.diagnose.hypothesis import first_point
from firmloop.diagnose.rank import Search
from firmloop.diagnose.refit import fit, noises_of
from firmloop.diagnose.rival import rated
from firmloop.diagnose.round import screened
from firmloop.identify.fitting.noise import white
from tests.diagnose.cases import concealed, scene_of


@pytest.mark.parametrize("name", ["coulomb_friction", ""])
def test_every_cause_is_tried(name: str, tmp_path: Path) -> None:
    scene = scene_of(concealed(tmp_path, name, 1.0, False))
    flat = [white(float(scene.train[0].columns[signal.name].std())) for signal in scene.plant.outputs]
    fitted = fit(scene, scene.train, (), first_point(scene, scene.train), flat, 24)
    nominal = rated(scene, fit(scene, scene.train, (), fitted.point, noises_of(scene, fitted.residuals), 24))
    again = exhausted(Search(scene, nominal, nominal, (), screened(scene, nominal), ()))
    assert (again.best.fitted.names if again else ()) == ((name,) if name else ())

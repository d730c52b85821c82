"""A cause that a screen has missed is found before anything is called unknown."""

from __future__ import annotations

from pathlib import Path

import pytest

from diagnose.exhaust import exhausted
from diagnose.hypothesis import first_point, make_scene
from diagnose.preflight import preflight
from diagnose.rank import Search
from diagnose.refit import fit, noises_of
from diagnose.rival import rated
from diagnose.round import screened
from firmloop.pipeline import plant_of, read_data
from firmloop.project import read_project
from identify.noise import white
from tests.diagnose.cases import concealed


@pytest.mark.parametrize("name", ["coulomb_friction", ""])
def test_every_cause_is_tried(name: str, tmp_path: Path) -> None:
    project = read_project(concealed(tmp_path, name, 1.0, False))
    plant, data = plant_of(project), read_data(project)
    scene = make_scene(plant, data.train, data.test, preflight(plant, data.train, data.test).floors)
    flat = [white(float(data.train[0].columns[signal.name].std())) for signal in plant.outputs]
    fitted = fit(scene, scene.train, (), first_point(scene, scene.train), flat, 24)
    nominal = rated(scene, fit(scene, scene.train, (), fitted.point, noises_of(scene, fitted.residuals), 24))
    again = exhausted(Search(scene, nominal, nominal, (), screened(scene, nominal), ()))
    assert (again.best.fitted.names if again else ()) == ((name,) if name else ())

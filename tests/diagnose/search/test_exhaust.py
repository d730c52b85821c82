"""A term that a screen has missed is found before anything is called unknown."""

from __future__ import annotations

from pathlib import Path

import pytest

from firmloop.diagnose.model.candidate import rated
from firmloop.diagnose.model.fit import fit, noises_of
from firmloop.diagnose.model.hypothesis import first_point
from firmloop.diagnose.search.exhaustive import exhausted
from firmloop.diagnose.search.found import Search
from firmloop.diagnose.search.round import screened
from firmloop.identify.fitting.noise import white
from tests.diagnose.cases import concealed, problem_of


@pytest.mark.parametrize("name", ["coulomb_friction", ""])
def test_every_term_is_tried(name: str, tmp_path: Path) -> None:
    problem = problem_of(concealed(tmp_path, name, 1.0, False))
    flat = [white(float(problem.train[0].columns[signal.name].std())) for signal in problem.plant.outputs]
    fitted = fit(problem, problem.train, (), first_point(problem, problem.train), flat, 24)
    nominal = rated(problem, fit(problem, problem.train, (), fitted.point, noises_of(problem, fitted.residuals), 24))
    again = exhausted(Search(problem, nominal, nominal, (), screened(problem, nominal), ()))
    assert (again.best.fitted.names if again else ()) == ((name,) if name else ())

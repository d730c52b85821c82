"""A term that a screen has missed is found before anything is called unknown."""

from __future__ import annotations

from pathlib import Path

import pytest

from firmloop.diagnose.search.exhaustive import exhausted
from firmloop.diagnose.search.found import Search
from firmloop.diagnose.search.round import screened
from firmloop.diagnose.search.stepwise import settled
from tests.diagnose.cases import concealed, nominal_of, problem_of, shortened


@pytest.mark.parametrize("name", ["coulomb_friction", ""])
def test_every_term_is_tried(name: str, tmp_path: Path) -> None:
    problem = problem_of(shortened(concealed(tmp_path, name, 1.0, False), 1000))
    nominal = nominal_of(problem)
    again = exhausted(Search(problem, nominal, nominal, (), screened(problem, nominal), ()))
    # A contact that hardly gives way may be as near; what it amounts to takes its place then.
    assert (settled(again).best.fitted.names if again else ()) == ((name,) if name else ())

"""The likeliest fit of the plant alone may simulate farther off than another: each is held against its like."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from firmloop.diagnose.data.checks import preflight
from firmloop.diagnose.model.candidate import Candidate, by_simulation_error, rms_of
from firmloop.diagnose.model.fit import fit
from firmloop.diagnose.model.hypothesis import Problem, first_point, make_problem
from firmloop.diagnose.search import held_out, stepwise
from firmloop.diagnose.search.from_given import nominal_fit
from firmloop.diagnose.search.harmless import as_identified
from firmloop.diagnose.search.held_out import _needs, _Part
from firmloop.diagnose.search.left_out import LeftOut
from firmloop.diagnose.search.round import screened
from firmloop.identify.fitting.noise import Noise, white
from tests.diagnose.cases import concealed, drawn, problem_of

OFFSET = 250070  # the seed of a motor whose current reads 0.2 A too much, under a torque that drifts


def _problem(project: Path) -> Problem:
    whole = problem_of(project)
    return make_problem(whole.plant, whole.train, (), preflight(whole.plant, whole.train, ()).floors)


def test_an_offset_beside_a_drift_is_what_the_likeliest_fit_misses_first(tmp_path: Path) -> None:
    problem = _problem(drawn(tmp_path, OFFSET))
    nominal = nominal_fit(problem, as_identified(problem.plant, problem.train))
    assert nominal.likelier is not None
    assert nominal.noises[0].rms < nominal.likeliest.noises[0].rms
    assert screened(problem, nominal.likeliest)[0].term.label == "sensor_offset of current_A"
    assert screened(problem, nominal)[0].term.label != "sensor_offset of current_A"


@pytest.mark.parametrize(
    ("score", "rms", "brings"),
    [
        pytest.param(-1100.0, 1.0, True, id="likelier than the likeliest without, and no farther off than the nearest"),
        pytest.param(-1010.0, 1.0, False, id="likelier than the nearest, and no more than the likeliest"),
        pytest.param(-1100.0, 1.5, True, id="farther off than the nearest, as the likeliest without is"),
        pytest.param(-1010.0, 1.5, False, id="as far off as the likeliest without, and hardly likelier"),
        pytest.param(-1100.0, 2.0, False, id="farther off than either"),
    ],
)
def test_what_an_effect_brings_is_held_against_the_likeliest_fit_without_it(
    score: float, rms: float, brings: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(stepwise, "_nearer", lambda _, candidate, base: candidate)
    monkeypatch.setattr(stepwise, "_accompanied", lambda _, candidate, base, worth: candidate)
    problem = _problem(concealed(tmp_path, "", 0.3, False))
    term = problem.term("coulomb_friction")
    assert term is not None
    begin = first_point(problem, problem.train)
    alone = fit(problem, problem.train, (), begin, [white(1.0)] * len(problem.plant.outputs), 0)
    beside = replace(alone, terms=(term,), residuals=tuple(0.9 * each for each in alone.residuals))

    def made(size: float, value: float) -> Candidate:
        return Candidate(alone, (Noise(np.zeros(0), size, size),) * len(problem.plant.outputs), value)

    nearest = replace(made(1.0, 0.0), likelier=made(1.5, -1000.0))
    tried = replace(made(rms, score), fitted=beside)
    held = stepwise._chosen(problem, (tried,), nearest, np.inf, 0.0)
    assert (held is not None) == brings
    assert stepwise._without(nearest, tried) == -1000.0


def test_outputs_weighed_as_something_else_leaves_them_keep_that_ratio(tmp_path: Path) -> None:
    problem = _problem(concealed(tmp_path, "", 0.3, False))
    begin = first_point(problem, problem.train)
    alone = fit(problem, problem.train, (), begin, [white(1.0)] * len(problem.plant.outputs), 0)
    sizes = np.array([3.0, 7.0])
    found = by_simulation_error(problem, alone, sizes)
    weights = np.array([noise.scale for noise in found.noises])
    assert weights / weights[0] == pytest.approx(sizes / sizes[0])
    left = rms_of(found.residuals)
    assert np.mean((left / weights) ** 2) == pytest.approx(1.0, rel=0.01)


def _part(after: float, refit: float, parts: int = 1, left: float = 3.0, train: float = 0.5) -> _Part:
    """Return a part that leaves `after` of what was left out, the refit `refit`, and a share of it in `train`."""
    out = LeftOut({"speed": {"after": after, "refit": refit}}, {"after": (np.ones((9, 1)),) * parts})
    fitted, nominal = (SimpleNamespace(terms=(), residuals=(np.full((9, 1), rms),)) for rms in (train, 1.0))
    best = SimpleNamespace(fitted=fitted, noises=(Noise(np.zeros(0), 1.0, left),))
    search = SimpleNamespace(best=best, nominal=SimpleNamespace(fitted=nominal))
    return _Part(search, False, out, 1.0)  # type: ignore[arg-type]


def test_what_foresees_far_more_than_the_refit_is_right_though_it_may_not_be_written() -> None:
    assert _part(0.02, 4.0).foresees
    assert not _part(3.0, 4.0).foresees
    assert _part(3.4, 4.0, left=1.0).foresees, "white noise is all that is left"
    assert not _part(3.8, 4.0, left=1.0).foresees
    assert not _part(0.02, 4.0, train=1.0).foresees, "it explains nothing of what the fit saw"
    assert not replace(_part(0.02, 4.0), left=LeftOut({}, {})).foresees


def test_an_effect_that_foresees_no_more_is_not_needed_where_other_parts_were_left_out() -> None:
    assert not _needs(_part(0.19, 4.7, 2), _part(0.08, 2.9, 1))
    assert _needs(_part(0.08, 2.9, 1), _part(0.19, 2.9, 2))


def test_what_ends_on_a_bound_foresees_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    assert _part(0.02, 4.0).foresees
    monkeypatch.setattr(held_out, "likely", lambda fitted: False)
    assert not _part(0.02, 4.0).foresees


@pytest.mark.parametrize("something", [True, False])
def test_what_is_as_likely_nothing_is_not_kept_below_the_noise_either(
    something: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of what simulates clearly nearer, though it begins where no reading says: it has to be something."""
    part = _part(3.4, 4.0)
    for name, said in (("_whole", part), ("_slimmed", None), ("noises_of", ()), ("oversized", False)):
        monkeypatch.setattr(held_out, name, lambda *_, said=said: said)
    monkeypatch.setattr(held_out, "likely", lambda fitted: something)
    found = SimpleNamespace(best=part.search.best, nominal=SimpleNamespace(noises=()), problem=None)
    kept = held_out._kept(found, SimpleNamespace())  # type: ignore[arg-type]
    assert (kept.search is not None) == something

"""Where the cost of a moment wanders, a fit finds the better place, and its interval is as wide as the cost allows."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from bench.diagnose.blind_cases import single_case
from firmloop.diagnose.model.fit import cost_at, deviations, ended, fit, inverse
from firmloop.diagnose.model.hypothesis import Point, first_point
from firmloop.diagnose.model.profile_likelihood import profiled
from firmloop.identify.fitting.noise import white
from tests.diagnose.cases import BY_NAME, concealed, problem_of, refitted, truths, written


def test_a_moment_is_taken_to_its_best_place(tmp_path: Path) -> None:
    """The search of this case ends 24 ms off, twelve deviations, in a place of its own."""
    case = single_case(1003, "load_step", BY_NAME["flat_motor"], ("speed", "current"), "mixed", True, 0.3)
    problem = problem_of(written(tmp_path, case))
    told = truths(tmp_path, "load_step")
    term = problem.term("load_step")
    assert term is not None
    moment, torque = (next(key for key in term.keys if key.endswith(end)) for end in (".time_s", ".torque_N_m"))
    begin = first_point(problem, problem.train)
    place = Point({**begin.values, moment: told["time"] - 0.024, torque: told["torque"]}, begin.starts)
    found, noises = refitted(problem, term, place, [1.0, 0.1])
    stuck = ended(problem, found, noises)
    best = profiled(problem, stuck, noises)
    off = {name: abs(each.point.values[moment] - told["time"]) for name, each in (("stuck", stuck), ("best", best))}
    assert off["stuck"] > 5 * deviations(stuck)[moment], "or the case shows nothing"
    assert off["best"] < 1.96 * deviations(best)[moment] < 0.01
    true = Point({**best.point.values, moment: told["time"]}, best.point.starts)
    assert cost_at(problem, best, best.point, noises) < cost_at(problem, best, true, noises)
    assert best.wider is not None and np.all(best.wider >= 1.0)


def test_a_wave_of_nothing_leads_nowhere(tmp_path: Path) -> None:
    """Its phase leaves no trace, so that no step of its size may turn it."""
    problem = problem_of(concealed(tmp_path, "", 1.0, False))
    term = problem.term("gravity_torque")
    assert term is not None
    begin = first_point(problem, problem.train)
    none = Point({**begin.values, **dict(zip(term.keys, (0.0, 0.5), strict=True))}, begin.starts)
    fitted = fit(problem, problem.train, (term,), none, [white(1.0), white(0.1)], 0)
    phase = [each.name for each in fitted.coordinates].index(term.keys[1])
    assert fitted.normal[phase, phase] == 0.0, "or the case shows nothing"
    covariance = inverse(fitted.normal)
    assert np.all(covariance[phase] == 0.0) and np.all(covariance[:, phase] == 0.0)
    assert deviations(fitted)[term.keys[1]] == np.inf

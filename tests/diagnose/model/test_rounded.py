"""Where readings rest at a sensor's limit they are rounded alike, and their number does not make it more certain."""

from __future__ import annotations

from pathlib import Path

from bench.diagnose.blind_cases import single_case
from firmloop.diagnose.model.batch_means import with_lasting
from firmloop.diagnose.model.fit import deviations, ended
from firmloop.diagnose.model.hypothesis import Point, entered, first_point
from tests.diagnose.cases import BY_NAME, problem_of, refitted, truths, written

CASES = 6
STEP = 5e-6  # m, of the position of the stage


def test_a_limit_is_no_more_certain_than_a_reading(tmp_path: Path) -> None:
    held = {"alone": 0, "rounded": 0}
    for seed in range(CASES):
        place = tmp_path / str(seed)
        case = single_case(seed, "sensor_saturation", BY_NAME["linear_stage"], ("position",), "triangle", False, 0.1)
        problem = problem_of(written(place, case))
        term = problem.term("sensor_saturation")
        assert term is not None
        begin, true = first_point(problem, problem.train), truths(place, "sensor_saturation")["limit"]
        values = {"mass_kg": 12.0, "b_N_s_m": 30.0}
        start = Point(entered({**begin.values, **values}, term, {term.keys[0]: true}), begin.starts)
        found, noises = refitted(problem, term, start, [1e-3])
        found = ended(problem, found, noises)
        off = abs(found.point.values[term.keys[0]] - true)
        for name, each in (("alone", found), ("rounded", with_lasting(problem, found, noises))):
            told = deviations(each)[term.keys[0]]
            held[name] += off < 1.96 * told
            assert name == "alone" or told >= 0.99 * STEP / 12.0**0.5
    assert held["alone"] <= CASES // 2, "or the cases show nothing"
    assert held["rounded"] == CASES

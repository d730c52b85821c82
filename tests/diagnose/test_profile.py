"""Where the cost of a moment wanders, a fit finds the better place, and its interval is as wide as the cost allows."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from bench.diagnose.blind_cases import single_case
from firmloop.diagnose.hypothesis import Point, first_point
from firmloop.diagnose.profile import profiled
from firmloop.diagnose.refit import cost_at, deviations, ended
from tests.diagnose.cases import BY_NAME, refitted, scene_of, truths, written


def test_a_moment_is_taken_to_its_best_place(tmp_path: Path) -> None:
    """The search of this case ends 24 ms off, twelve deviations, in a place of its own."""
    case = single_case(1003, "load_step", BY_NAME["flat_motor"], ("speed", "current"), "mixed", True, 0.3)
    scene = scene_of(written(tmp_path, case))
    told = truths(tmp_path, "load_step")
    cause = scene.cause("load_step")
    assert cause is not None
    moment, torque = (next(key for key in cause.keys if key.endswith(end)) for end in (".time_s", ".torque_N_m"))
    begin = first_point(scene, scene.train)
    place = Point({**begin.values, moment: told["time"] - 0.024, torque: told["torque"]}, begin.starts)
    found, noises = refitted(scene, cause, place, [1.0, 0.1])
    stuck = ended(scene, found, noises)
    best = profiled(scene, stuck, noises)
    off = {name: abs(each.point.values[moment] - told["time"]) for name, each in (("stuck", stuck), ("best", best))}
    assert off["stuck"] > 5 * deviations(stuck)[moment], "or the case shows nothing"
    assert off["best"] < 1.96 * deviations(best)[moment] < 0.01
    true = Point({**best.point.values, moment: told["time"]}, best.point.starts)
    assert cost_at(scene, best, best.point, noises) < cost_at(scene, best, true, noises)
    assert best.wider is not None and np.all(best.wider >= 1.0)

"""Where readings rest at a sensor's limit they are rounded alike, and their number does not make it more certain."""

from __future__ import annotations

from pathlib import Path

from bench.diagnose.blind_cases import single_case
from firmloop.diagnose.hypothesis import Point, entered, first_point
from firmloop.diagnose.lasting import with_lasting
from firmloop.diagnose.refit import deviations, ended
from tests.diagnose.cases import BY_NAME, refitted, scene_of, truths, written

CASES = 6
STEP = 5e-6  # m, of the position of the stage


def test_a_limit_is_no_more_certain_than_a_reading(tmp_path: Path) -> None:
    held = {"alone": 0, "rounded": 0}
    for seed in range(CASES):
        place = tmp_path / str(seed)
        case = single_case(seed, "sensor_saturation", BY_NAME["linear_stage"], ("position",), "triangle", False, 0.1)
        scene = scene_of(written(place, case))
        cause = scene.cause("sensor_saturation")
        assert cause is not None
        begin, true = first_point(scene, scene.train), truths(place, "sensor_saturation")["limit"]
        values = {"mass_kg": 12.0, "b_N_s_m": 30.0}
        start = Point(entered({**begin.values, **values}, cause, {cause.keys[0]: true}), begin.starts)
        found, noises = refitted(scene, cause, start, [1e-3])
        found = ended(scene, found, noises)
        off = abs(found.point.values[cause.keys[0]] - true)
        for name, each in (("alone", found), ("rounded", with_lasting(scene, found, noises))):
            told = deviations(each)[cause.keys[0]]
            held[name] += off < 1.96 * told
            assert name == "alone" or told >= 0.99 * STEP / 12.0**0.5
    assert held["alone"] <= CASES // 2, "or the cases show nothing"
    assert held["rounded"] == CASES

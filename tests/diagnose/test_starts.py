"""Where a machine rests at first, its place is found though a speed would look the same."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from firmloop.diagnose.hypothesis import Point, entered, first_point
from firmloop.diagnose.refit import fit, noises_of
from firmloop.diagnose.rival import unseen_residuals
from firmloop.identify.fitting.noise import white
from tests.diagnose.cases import drawn, scene_of, truths

SEED = 780124  # a stage that rests at first, of dry friction and a slew rate


def test_a_stage_at_rest_is_found_where_it_is(tmp_path: Path) -> None:
    scene = scene_of(drawn(tmp_path, SEED))
    causes = [cause for cause in map(scene.cause, ("asymmetric_friction", "slew_rate_limit")) if cause is not None]
    begin = first_point(scene, scene.train)
    values = {**begin.values, "mass_kg": 12.0, "b_N_s_m": 30.0}
    for cause in causes:
        told = truths(tmp_path, cause.effect.name)
        values = dict(entered(values, cause, {key: told[key.split(".")[1].split("_")[0]] for key in cause.keys}))
    found = fit(scene, scene.train, causes, Point(values, begin.starts), [white(1.44e-6)], 40)
    for _ in range(4):
        found = fit(scene, scene.train, causes, found.point, noises_of(scene, found.residuals), 40)
    train, test = (
        float(np.sqrt(np.mean(np.concatenate(parts) ** 2)))
        for parts in (found.residuals, unseen_residuals(scene, found, noises_of(scene, found.residuals)))
    )
    assert test < 1.01 * train

"""Where an effect has no place, and which of its values are not its own: those only stand for what else is missing."""

from __future__ import annotations

import numpy as np
import pytest

from firmloop.identify.plants.effects import candidates, find_effect
from firmloop.identify.plants.kinds import make_plant
from firmloop.identify.recordings.recording import make_recording
from firmloop.identify.simulation.superset import scales_of

LAG = {"gain": 2.0, "natural_frequency_rad_s": 40.0, "damping_ratio": 0.1, "delay_s": 0.0}
WAVES = {"gravity_torque", "cogging_torque", "torque_ripple", "eccentric_encoder"}


@pytest.mark.parametrize(
    ("output", "waves"),
    [("position_rad", WAVES), ("output_V", set()), ("position_m", {"cogging_torque", "torque_ripple"})],
)
def test_what_has_no_angle_has_no_waves_per_turn(output: str, waves: set[str]) -> None:
    named = {effect.name for effect in candidates(make_plant("second_order", "drive_V", [output], LAG))}
    assert named & WAVES == waves and "hardening_spring" in named


@pytest.mark.parametrize(
    ("effect", "level", "swing", "value", "own"),
    [
        pytest.param("input_saturation", 50.0, 4.0, 44.0, False, id="a limit below every command"),
        pytest.param("input_saturation", 50.0, 4.0, 52.0, True, id="a limit among them"),
        pytest.param("input_saturation", 0.0, 8.0, 6.5, True, id="a limit on either side"),
        pytest.param("sensor_lag", 0.0, 8.0, 9.0, False, id="a lag that nothing recorded sees the end of"),
        pytest.param("sensor_lag", 0.0, 8.0, 0.5, True, id="a lag that is over soon"),
    ],
)
def test_a_value_at_which_nothing_is_left_of_the_command_is_none(
    effect: str, level: float, swing: float, value: float, own: bool
) -> None:
    plant, time = make_plant("second_order", "drive_V", ["position_rad"], LAG), np.arange(200) * 0.05
    columns = {"drive_V": level + swing * np.sign(np.sin(time)), "position_rad": np.sin(time)}
    scales = scales_of(plant, [make_recording(time, columns, "log.csv", "")], 0, 0)
    believable = find_effect(effect).believable
    assert believable is not None and believable([value], scales) is own

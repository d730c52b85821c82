"""What a recording shows at rest before anything drives begins at rest, and no fit lets it begin in motion."""

from __future__ import annotations

import numpy as np
import pytest

from firmloop.identify.fitting.fit import estimate
from firmloop.identify.fitting.own_values import by_itself
from firmloop.identify.plants.kinds import make_plant
from firmloop.identify.plants.plant import Plant
from firmloop.identify.recordings.conditioning import NONE
from firmloop.identify.recordings.recording import Recording, make_recording
from firmloop.identify.simulation.at_rest import known_states, switched_on

MOTOR = {
    "R_ohm": {"value": 7.0, "free": False},
    "L_H": {"value": 0.0, "free": False},
    "ke_V_s_rad": 0.46,
    "kt_N_m_A": 0.46,
    "J_kg_m2": 3e-3,
    "b_N_m_s_rad": 1e-3,
}
STEP_S = 6e-3


def motor(output: str) -> Plant:
    return make_plant("dc_motor", "voltage_V", [output], MOTOR)


def geared(duty: float, rest: int, noise: float = 0.0, begins: float = 0.0) -> Recording:
    """Turn a motor that goes hardly faster for more than it goes for half of all, and not at all for less.

    Its encoder counts hundredths of a radian; before the step it `begins` with a speed that dies out in a second.
    """
    time = np.arange(700) * STEP_S
    volts = np.where(np.arange(700) < rest, 0.0, duty)
    ends = np.where(volts > 0.4, 10.0 + 4.0 * (volts - 0.5), 0.0)
    speed = np.zeros(700)
    speed[0] = begins
    for k in range(699):
        speed[k + 1] = speed[k] + (ends[k] - speed[k]) * STEP_S / (0.08 if k >= rest else 1.0)
    angle = np.concatenate(([0.0], np.cumsum(speed[:-1]) * STEP_S))
    drawn = np.random.default_rng(3).normal(0.0, 1.0, 700) * noise
    columns = {
        "voltage_V": volts,
        "speed_rad_s": speed + drawn,
        "position_rad": np.round((angle + drawn) / 0.01) * 0.01,
    }
    return make_recording(time, columns, f"{duty}.csv", "")


@pytest.mark.parametrize(
    ("output", "recording", "known"),
    [
        ("position_rad", geared(0.8, 100), ("speed_rad_s",)),  # where it stands, the first reading says
        ("position_rad", geared(0.8, 100, noise=0.02), ("speed_rad_s",)),
        ("position_rad", geared(0.8, 4), ()),  # four rows tell nothing
        ("position_rad", geared(0.8, 100, begins=2.0), ()),  # it moves
        ("position_rad", geared(0.8, 100, noise=3.0), ("speed_rad_s",)),
        ("position_rad", geared(0.8, 8, noise=0.3), ()),  # eight rows leave a speed that would take it far
        ("speed_rad_s", geared(0.8, 8, noise=0.03), ("speed_rad_s",)),
        ("speed_rad_s", geared(0.8, 700), ()),  # nothing ever drives
    ],
)
def test_known_is_what_rows_at_rest_leave_no_doubt_of(
    output: str, recording: Recording, known: tuple[str, ...]
) -> None:
    plant = motor(output)
    assert tuple(plant.states[k].name for k in known_states(plant, recording)) == known


def test_a_fit_does_not_begin_in_motion_what_stands_still() -> None:
    """Speeds of its own for each run would let a motor without back EMF pass for one that hardly follows its duty."""
    runs = [geared(duty, 100) for duty in (0.3, 0.5, 0.6, 0.8, 1.0)]
    plant = motor("position_rad")
    found = estimate(plant, runs, [], NONE)
    speed = [signal.name for signal in plant.states].index("speed_rad_s")
    assert [float(score.starts[0, speed]) for score in found.train] == [0.0] * 5
    assert next(each.value for each in found.plant.parameters if each.name == "ke_V_s_rad") > 0.05


@pytest.mark.parametrize(
    ("output", "recording", "steps"),
    [
        ("speed_rad_s", geared(0.8, 0), True),
        ("speed_rad_s", geared(0.8, 0, begins=2.0), False),  # it turns already
        ("speed_rad_s", geared(0.8, 100), False),  # undriven rows tell more
        ("position_rad", geared(0.8, 0), False),  # where it stands it may pass by
    ],
)
def test_what_is_switched_on_in_its_first_row_has_a_current_of_zero_there(
    output: str, recording: Recording, steps: bool
) -> None:
    plant = make_plant("dc_motor", "voltage_V", [output], {**MOTOR, "L_H": 1e-3})
    assert plant.states[0].name == "current_A"
    assert switched_on(plant, recording) is steps
    assert (known_states(plant, recording) == (0,)) is steps


def test_a_step_that_begins_in_the_first_row_does_not_move_by_itself() -> None:
    plant = motor("speed_rad_s")
    assert not by_itself(plant, geared(0.8, 0))
    assert by_itself(plant, geared(0.8, 0, begins=2.0))

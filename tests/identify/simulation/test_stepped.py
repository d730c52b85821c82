"""A plant moved period by period goes where the simulator takes it when it knows the whole input at once."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bench.links.closed_loop import wheel
from firmloop.identify.error import IdentifyError
from firmloop.identify.plants.attach import with_effects
from firmloop.identify.plants.kinds import make_plant
from firmloop.identify.plants.plant import Plant
from firmloop.identify.recordings.recording import make_recording
from firmloop.identify.simulation.simulate import simulate
from firmloop.identify.simulation.stepped import SteppedPlant
from tests.sizes import EFFECTS_OF_A_MOTOR, EFFECTS_OF_A_STAGE, motor, stage, use_of

PERIOD = 0.001


def tank(delay: float) -> Plant:
    values = {"gain": 2.0, "time_constant_s": 0.05, "delay_s": delay}
    table = {name: {"value": value, "free": False} for name, value in values.items()}
    return make_plant("first_order", "voltage_V", ["temperature_C"], table)


def both(plant: Plant, rows: int) -> tuple[np.ndarray, np.ndarray]:
    """Return what the simulator and the stepped plant say to the same steps of the input."""
    drive = np.repeat(np.random.default_rng(1).normal(size=rows // 20), 20) * 6.0
    time = np.arange(len(drive)) * PERIOD
    zeros = {signal.name: np.zeros(len(drive)) for signal in plant.outputs}
    recording = make_recording(time, {plant.inputs[0].name: drive, **zeros}, "test", "")
    expected = simulate(plant, recording, np.zeros(len(plant.states)))
    stepped, got = SteppedPlant(plant, PERIOD), np.empty_like(expected)
    for k, value in enumerate(drive):
        got[k] = stepped.read()
        stepped.apply(np.array([value]))
    return expected, got


@pytest.mark.parametrize("plant", [wheel(), tank(0.0), tank(0.003), tank(0.0037)], ids=["wheel", "0", "3", "3.7"])
def test_steps_follow_the_simulator(plant: Plant) -> None:
    expected, got = both(plant, 400)
    np.testing.assert_allclose(got, expected, rtol=0, atol=1e-8 * np.abs(expected).max())


@pytest.mark.parametrize(
    ("plant", "name"),
    [(motor("speed_rad_s", "position_rad", "current_A"), name) for name in EFFECTS_OF_A_MOTOR]
    + [(stage("position_m", "speed_m_s"), name) for name in EFFECTS_OF_A_STAGE],
    ids=lambda value: value if isinstance(value, str) else value.kind,
)
def test_every_effect_is_stepped_as_it_is_simulated(plant: Plant, name: str) -> None:
    expected, got = both(with_effects(plant, [use_of(plant, name)]), 500)
    if name == "clock_skew":  # the recorder's clock is none of the controller's
        expected, _ = both(plant, 500)
    assert np.max(np.abs(got - expected) / np.abs(expected).max(axis=0)) < 1e-6


def test_a_plant_that_grows_without_bound_is_told() -> None:
    plant = motor("speed_rad_s")
    wild = replace(
        plant, parameters=tuple(replace(p, value=-1.0) if p.name.startswith("b_") else p for p in plant.parameters)
    )
    stepped = SteppedPlant(wild, PERIOD)
    with pytest.raises(IdentifyError, match="grows without bound"):
        for _ in range(2000):
            stepped.apply(np.array([1.0]))

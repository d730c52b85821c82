"""Recordings that cannot be diagnosed get a sentence, and never a name."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from firmloop.diagnose.data.checks import preflight
from firmloop.identify.error import IdentifyError
from firmloop.identify.plants.plant import Plant
from firmloop.identify.recordings.recording import Recording, make_recording
from firmloop.project.project import read_project
from firmloop.stages.data import read_data
from firmloop.stages.plant import plant_of
from tests.diagnose.cases import concealed

Array = NDArray[np.float64]
Change = Callable[[dict[str, Array]], Mapping[str, Array]]


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> tuple[Plant, Recording, Recording]:
    project = read_project(concealed(tmp_path_factory.mktemp("preflight"), "", 1.0, False))
    data = read_data(project)
    return plant_of(project), data.train[0], data.test[0]


def still(values: Array) -> Array:
    """Return noise around a level."""
    return 3.0 + 0.01 * np.random.default_rng(1).normal(size=len(values))


@pytest.mark.parametrize(
    ("level", "moving", "says"),
    [
        (3.0, True, "3 in every row, so that the step itself is not in the file: .* to begin there where the readings"),
        (3.0, False, "3 in every row, so that the step itself is not in the file: .* to begin there from rest"),
        (0.0, True, "0 in every row; what moves there is taken to move by itself"),
    ],
)
def test_an_input_that_never_changes_is_noted_where_something_moves(
    level: float, moving: bool, says: str, bench: tuple[Plant, Recording, Recording]
) -> None:
    plant, train, _ = bench
    fast = int(np.argmax(np.abs(train.columns["speed_rad_s"])))
    held = {name: np.roll(values, -fast) if moving else values for name, values in train.columns.items()}
    if not moving:
        held = {name: values - values[0] for name, values in held.items()}
    coasting = make_recording(train.time, {**held, "voltage_V": 0.0 * train.time + level}, "coast.csv", "")
    notes = preflight(plant, [train, coasting], []).notes
    assert any(re.match(f"coast.csv: voltage_V is {says}", note) for note in notes), notes


def test_inputs_held_at_another_level_in_each_recording_are_steps(bench: tuple[Plant, Recording, Recording]) -> None:
    plant, train, _ = bench
    held = [
        make_recording(train.time, {**train.columns, "voltage_V": 0.0 * train.time + level}, f"{level:g}.csv", "")
        for level in (3.0, 6.0)
    ]
    assert not any("in every row" in note for note in preflight(plant, held, []).notes)


def test_sound_recordings_pass(bench: tuple[Plant, Recording, Recording]) -> None:
    plant, train, test = bench
    assert preflight(plant, [train], [test]).notes == ()


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda c: {**c, "speed_rad_s": c["speed_rad_s"] * 60.0 / (2.0 * np.pi)}, "rpm"),
        (lambda c: {**c, "current_A": 1000.0 * c["current_A"]}, "mA"),
        (lambda c: {**c, "speed_rad_s": 0.0 * c["speed_rad_s"]}, "in every row"),
        (lambda c: {**{name: still(values) for name, values in c.items()}, "voltage_V": 0.0 * c["voltage_V"]}, "never"),
        (lambda c: {**c, "speed_rad_s": -c["speed_rad_s"]}, "sign"),
    ],
)
def test_wrong_columns_are_told(bench: tuple[Plant, Recording, Recording], change: Change, says: str) -> None:
    plant, train, _ = bench
    made = make_recording(train.time, change(dict(train.columns)), "bad.csv", "")
    with pytest.raises(IdentifyError, match=says):
        preflight(plant, [made], [])


def test_a_clock_that_jumps_is_told(bench: tuple[Plant, Recording, Recording]) -> None:
    plant, train, _ = bench
    time = train.time + np.where(np.arange(len(train.time)) > 2000, 3.0, 0.0)
    with pytest.raises(IdentifyError, match="jumps"):
        preflight(plant, [make_recording(time, train.columns, "bad.csv", "")], [])


def test_few_rows_are_told(bench: tuple[Plant, Recording, Recording]) -> None:
    plant, train, _ = bench
    short = make_recording(train.time[:5], {k: v[:5] for k, v in train.columns.items()}, "bad.csv", "")
    with pytest.raises(IdentifyError, match="5 rows"):
        preflight(plant, [short], [])


def test_the_same_file_twice_is_told(bench: tuple[Plant, Recording, Recording]) -> None:
    plant, train, _ = bench
    with pytest.raises(IdentifyError, match="same bytes"):
        preflight(plant, [train], [make_recording(train.time, train.columns, "copy.csv", train.sha256)])


@pytest.mark.parametrize(("name", "factor"), [("kt_N_m_A", 10.0), ("kt_N_m_A", 0.1), ("ke_V_s_rad", 0.1)])
def test_two_constants_that_are_given_far_apart_are_told(
    bench: tuple[Plant, Recording, Recording], name: str, factor: float
) -> None:
    """The outputs show the torque constant over the inertia alone."""
    plant, train, _ = bench
    moved = tuple(
        replace(each, value=each.value * (factor if each.name == name else 1.0), free=True) for each in plant.parameters
    )
    (note,) = preflight(replace(plant, parameters=moved), [train], []).notes
    assert "one constant in SI units" in note and "kt_N_m_A" in note and "ke_V_s_rad" in note

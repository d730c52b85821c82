"""The controller half is played again: what the firmware does otherwise is named, and nothing else is."""

from __future__ import annotations

import json
from pathlib import Path

import jsonschema
import numpy as np
import pytest

from firmloop.cli import main
from firmloop.diagnose.controller.replay import Cut, cut
from firmloop.identify.recordings.recording import Recording, make_recording
from firmloop.project.project import read_project
from firmloop.stages.data import read_data
from firmloop.stages.plant import plant_of
from firmloop.stages.recorded_controller import controller_of
from tests.diagnose.controller.closed import GAINS, Firmware, project


def _cut(file: Path, change: object = None) -> Cut | None:
    made = read_project(file)
    controller = controller_of(made)
    assert controller is not None
    recordings = list(read_data(made).train)
    if change is not None:
        assert callable(change)
        recordings = [change(each) for each in recordings]
    return cut(plant_of(made), controller, recordings)


@pytest.mark.parametrize(
    ("made", "how"),
    [
        (Firmware(), {}),
        (Firmware(), {"step": 0.5}),  # a coarse encoder
        (Firmware(), {"digits": 4}),
        (Firmware(), {"skip": 333}),  # the recording begins in the middle of the run
        (Firmware(friction=3e-3), {}),  # what the plant does is none of its business
    ],
)
def test_a_right_controller_is_left_alone(tmp_path: Path, made: Firmware, how: dict[str, float]) -> None:
    found = _cut(project(tmp_path, made, rows=800, **how))
    assert found is not None and not found.guilty and found.notes == ()
    assert found.same > 0.99 * found.samples > 500


@pytest.mark.parametrize(
    ("made", "name", "what", "figure"),
    [
        (Firmware(gains={"kp": 0.06}), "controller_gain", "kp", 0.06),
        pytest.param(Firmware(gains={"ki": 1.0}), "controller_gain", "ki", 1.0, marks=pytest.mark.slow),
        pytest.param(Firmware(limit=2.5), "controller_saturation", "other", 2.5, marks=pytest.mark.slow),
        (Firmware(limit=1e9), "controller_saturation", "none", None),
        pytest.param(Firmware(leaky=True), "controller_saturation", "output alone", None, marks=pytest.mark.slow),
        pytest.param(Firmware(windup=False), "controller_anti_windup", "none", None, marks=pytest.mark.slow),
        (Firmware(late=1), "controller_delay", "command", 1.0),
        pytest.param(Firmware(late_input=2), "controller_delay", "measurement", 2.0, marks=pytest.mark.slow),
        (Firmware(every=2), "controller_period", "steps", 2e-3),
        pytest.param(Firmware(scale=1.2), "controller_scale", "measurement", 1.2, marks=pytest.mark.slow),
        pytest.param(Firmware(sign=-1.0), "controller_sign", "output", -1.0, marks=pytest.mark.slow),
    ],
)
def test_a_fault_is_named(tmp_path: Path, made: Firmware, name: str, what: str, figure: float | None) -> None:
    found = _cut(project(tmp_path, made, rows=800))
    assert found is not None
    (blame,) = found.blames
    assert (blame.fault.name, blame.fault.what) == (name, what)
    if figure is not None:
        assert blame.figure == pytest.approx(figure, rel=1e-4)


@pytest.mark.slow
def test_two_wrong_gains_are_both_named(tmp_path: Path) -> None:
    found = _cut(project(tmp_path, Firmware(gains={"kp": 0.06, "ki": 1.0}), rows=800))
    assert found is not None
    figures = {blame.fault.what: blame.figure for blame in found.blames}
    assert figures == pytest.approx({"kp": 0.06, "ki": 1.0}, rel=1e-4)


def _changed(recording: Recording, **columns: object) -> Recording:
    made = {**recording.columns, **columns}
    return make_recording(recording.time, made, recording.source, "")  # type: ignore[arg-type]


def test_a_logger_may_be_noisy(tmp_path: Path) -> None:
    random = np.random.default_rng(3)

    def measured(recording: Recording) -> Recording:
        volts = recording.columns["voltage_V"]
        return _changed(recording, voltage_V=volts + random.normal(0.0, 0.05, len(volts)))

    right = _cut(project(tmp_path / "right", Firmware(), rows=800), measured)
    assert right is not None and not right.guilty
    wrong = _cut(project(tmp_path / "wrong", Firmware(gains={"kp": 0.06}), rows=800), measured)
    assert wrong is not None
    (blame,) = wrong.blames
    assert blame.fault.what == "kp" and blame.deviation is not None
    assert abs(blame.figure - 0.06) < 3.0 * blame.deviation < 0.002


def test_a_clock_that_runs_slow_is_told(tmp_path: Path) -> None:
    def slow(recording: Recording) -> Recording:
        return make_recording(1.2 * recording.time, recording.columns, recording.source, "")

    found = _cut(project(tmp_path, Firmware(), rows=800), slow)
    assert found is not None
    (blame,) = found.blames
    assert blame.fault.name == "controller_period" and blame.figure == pytest.approx(1.2e-3)


@pytest.mark.slow
def test_what_another_controller_did_is_no_fault(tmp_path: Path) -> None:
    def still(recording: Recording) -> Recording:
        return _changed(recording, reference_rad_s=0.0 * recording.time)

    found = _cut(project(tmp_path, Firmware(), rows=800), still)
    assert found is not None and not found.guilty
    assert "another controller" in found.notes[0]


@pytest.mark.slow
def test_rows_that_miss_steps_are_told(tmp_path: Path) -> None:
    def coarse(recording: Recording) -> Recording:
        columns = {name: values[::10] for name, values in recording.columns.items()}
        return make_recording(recording.time[::10], columns, recording.source, "")

    found = _cut(project(tmp_path, Firmware(), rows=3000), coarse)
    assert found is not None and not found.guilty
    assert "cannot be replayed" in found.notes[0]


def test_without_a_reference_there_is_nothing_to_say(tmp_path: Path) -> None:
    def bare(recording: Recording) -> Recording:
        columns = {name: values for name, values in recording.columns.items() if name != "reference_rad_s"}
        return make_recording(recording.time, columns, recording.source, "")

    assert _cut(project(tmp_path, Firmware(), rows=800), bare) is None


@pytest.mark.slow
def test_gains_that_a_rule_finds_are_nobodys_promise(tmp_path: Path) -> None:
    controller = 'tune = "simc"\ntau_c_s = 0.01\nu_min = -4\nu_max = 4\nb = 0.8'
    found = _cut(project(tmp_path, Firmware(gains={"kd": 0.0}), controller, rows=800))
    assert found is not None and not found.guilty and found.notes


def test_the_command_line_blames_the_controller(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = project(tmp_path, Firmware(gains={"kp": 0.06}), rows=800)
    assert main(["diagnose", str(file), "--out", str(tmp_path / "out")]) == 1
    said = json.loads((tmp_path / "out" / "diagnosis.json").read_text(encoding="utf-8"))
    schema = Path(__file__).parents[2] / "schema" / "diagnosis.schema.json"
    jsonschema.validate(said, json.loads(schema.read_text(encoding="utf-8")))
    assert said["verdict"] == "explained" and said["half"] == "controller"
    assert said["location"]["equation"] == "controller" and said["location"]["output"] == "voltage_V"
    (effect,) = said["effects"]
    assert effect["name"] == "controller_gain"
    low, high = effect["parameters"]["kp"]["ci95"]
    assert low <= 0.06 <= high and GAINS["kp"] < low
    assert "kp = 0.06" in capsys.readouterr().out

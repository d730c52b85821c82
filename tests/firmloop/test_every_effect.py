"""A project that carries an effect, as `diagnose` writes it, is taken as it is by every verb that needs a plant."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from firmloop.cli import main
from firmloop.identify.plants.attach import with_effects
from firmloop.identify.plants.plant import Plant
from firmloop.identify.plants.plant_table import effects_table
from firmloop.identify.simulation.linearize import linearize
from firmloop.project.project import read_project
from firmloop.stages.making import design
from firmloop.stages.plant import plant_of
from tests.sizes import EFFECTS_OF_A_MOTOR, EFFECTS_OF_A_STAGE, MOTOR, STAGE, motor, stage, use_of

HEAD = """schema = 1
name = "m"
[arithmetic]
number = "float32"
[target]
names = ["host"]
[plant.parameters]
"""
CONTROLLERS = {
    "pid": 'kind = "pid"\nkp = 0.05\nki = 1.0',
    "state_feedback": (
        'kind = "state_feedback"\nobserver = "kalman"\nQ = [1.0, 1.0]\nR = 1.0\n'
        "process_noise = [1.0, 1.0]\nmeasurement_noise = 1.0"
    ),
}


def project(plant: Plant, values: dict[str, float], names: tuple[str, ...], controller: str) -> str:
    """Write a project with these effects."""
    unit, drive = plant.outputs[0].unit, plant.inputs[0]
    span = 400 if unit == "rad/s" else 2
    lines = [f"{name} = {{ value = {value!r}, free = true }}" for name, value in values.items()]
    lines += ["[plant]", f'kind = "{plant.kind}"', f'input = "{drive.name}"']
    lines += [f"outputs = {json.dumps([signal.name for signal in plant.outputs])}"]
    for entry in effects_table(with_effects(plant, [use_of(plant, name) for name in names])):
        lines += ["[[plant.effects]]", *(f"{key} = {json.dumps(value)}" for key, value in entry.items())]
    lines += ["[controller]", "period_s = 0.001", CONTROLLERS.get(controller, controller), "[signals]"]
    lines += [f'{wire} = {{ unit = "{unit}", low = {-span}, high = {span} }}' for wire in ("reference", "measurement")]
    lines += [f'output = {{ unit = "{drive.unit}", low = -12, high = 12 }}']
    return HEAD + "\n".join(lines) + "\n"


def every(machine: str, controller: str) -> list[tuple[str, str]]:
    """Return the name of every effect with a project that has it."""
    plant = motor("speed_rad_s", "current_A") if machine == "motor" else stage("position_m")
    values, names = (MOTOR, EFFECTS_OF_A_MOTOR) if machine == "motor" else (STAGE, EFFECTS_OF_A_STAGE)
    return [(name, project(plant, values, (name,), controller)) for name in names]


@pytest.mark.parametrize("controller", CONTROLLERS)
@pytest.mark.parametrize("machine", ["motor", "stage"])
def test_every_effect_can_be_designed_for(machine: str, controller: str, tmp_path: Path) -> None:
    file = tmp_path / "p.toml"
    for name, text in every(machine, controller):
        file.write_text(text)
        read = read_project(file)
        plant = plant_of(read)
        assert [use.name for use in plant.effects] == [name]
        law = design(read, plant).law
        assert len(law.outputs) == 1, name
        assert np.all(np.isfinite(linearize(plant).a)), name


@pytest.mark.slow
@pytest.mark.parametrize("controller", CONTROLLERS)
@pytest.mark.parametrize("machine", ["motor", "stage"])
def test_every_effect_goes_through_the_verbs(machine: str, controller: str, tmp_path: Path) -> None:
    file, failed = tmp_path / "p.toml", []
    for name, text in every(machine, controller):
        file.write_text(text)
        for verb in ("design", "generate"):
            if main([verb, str(file), "--out", str(tmp_path / verb)]) != 0:
                failed.append((name, verb))
    assert failed == []


def test_a_feedforward_is_worth_its_tracking(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    names = ("stribeck_friction", "gravity_torque", "dead_zone", "input_delay")
    controller = CONTROLLERS["pid"] + '\n[controller.feedforward]\nfrom = "effects"\nposition = "angle"\nsmooth = 2.0'
    text = project(motor("speed_rad_s", "current_A"), MOTOR, names, controller)
    file = tmp_path / "p.toml"
    file.write_text(text + 'angle = { unit = "rad", low = -50, high = 50 }\n')
    assert main(["verify", str(file), "--out", str(tmp_path / "out"), "--steps", "50", "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    followed = said["tracking"]
    assert followed["with_feedforward"]["rms"] < 0.7 * followed["without_feedforward"]["rms"]
    assert main(["design", str(file), "--out", str(tmp_path / "design"), "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["controller"]["not_met_by_feedforward"].keys() == {"input_delay"}

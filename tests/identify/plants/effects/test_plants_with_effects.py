"""Plants with effects behave like plants: neutral is nothing, fits find them, projects keep them, slopes are right."""

from __future__ import annotations

import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from firmloop.cli import main
from firmloop.identify.error import IdentifyError
from firmloop.identify.fitting.fit import fit
from firmloop.identify.plants.attach import EffectUse, all_uses, parameters_of, with_effects
from firmloop.identify.plants.effects import candidates, effects, find_effect
from firmloop.identify.plants.kinds import make_plant
from firmloop.identify.plants.plant import Plant
from firmloop.identify.plants.plant_table import effects_table, plant_from_table
from firmloop.identify.recordings.conditioning import NONE
from firmloop.identify.recordings.recording import Recording, make_recording, write_recording
from firmloop.identify.simulation.linearize import linearize
from firmloop.identify.simulation.simulate import rest_start, simulate
from firmloop.identify.simulation.superset import starts_of, superset

MOTOR = {
    "R_ohm": 8.0, "L_H": 1e-3, "ke_V_s_rad": 0.02, "kt_N_m_A": 0.02, "J_kg_m2": 3e-6, "b_N_m_s_rad": 3e-6,
}  # fmt: skip
STAGE = {"mass_kg": 2.0, "b_N_s_m": 4.0}
EFFECTS_OF_CONTRACT = 36


def motor(*outputs: str, inductance: float = 1e-3) -> Plant:
    """Make a small motor whose torque constant is known."""
    values = {**MOTOR, "L_H": inductance}
    given = {name: {"value": value, "free": name not in ("L_H", "kt_N_m_A")} for name, value in values.items()}
    return make_plant("dc_motor", "voltage_V", outputs, given)


def stage(drive: str = "force_N") -> Plant:
    """Make a carriage."""
    extra = {} if drive == "force_N" else {"force_per_unit": {"value": 3.0, "free": False}}
    return make_plant("linear_stage", drive, ["position_m"], {**STAGE, **extra})


def driven(plant: Plant, size: float, rows: int = 600, seed: int = 4) -> Recording:
    """Drive a plant by steps, and record what it does at rest everywhere else."""
    time = np.arange(rows) * 1e-3
    steps = np.repeat(np.random.default_rng(seed).uniform(-size, size, rows // 30), 30)
    still = {signal.name: np.zeros(rows) for signal in plant.outputs}
    bare = make_recording(time, {plant.inputs[0].name: steps, **still}, "driven", "")
    shown = simulate(plant, bare, None)
    columns = {signal.name: shown[:, k] for k, signal in enumerate(plant.outputs)}
    return make_recording(time, {plant.inputs[0].name: steps, **columns}, "driven", "")


def test_the_library_holds_the_contract() -> None:
    assert len(effects()) == EFFECTS_OF_CONTRACT + 13, "capacitor, iron, bridges, AC axes, drivers, two stops too"
    for effect in effects().values():
        assert effect.says and effect.experiment and effect.term
        assert all(name in effects() for name in effect.confusable_with), effect.name


@pytest.mark.parametrize("outputs", [("speed_rad_s", "current_A"), ("position_rad",)])
@pytest.mark.parametrize("inductance", [1e-3, 0.0])
def test_neutral_effects_change_nothing(outputs: tuple[str, ...], inductance: float) -> None:
    plant = motor(*outputs, inductance=inductance)
    recording = driven(plant, 8.0)
    nominal, with_all = simulate(plant, recording, None), superset(plant).simulate(recording, {}, None)
    # Without inductance the current of effects follows within 1e-8 s instead of at once.
    allowed = 1e-12 if inductance else 1e-6
    assert np.all(np.abs(nominal - with_all) <= allowed * np.abs(nominal).max(axis=0))


def test_neutral_effects_change_nothing_on_a_carriage() -> None:
    plant = stage()
    recording = driven(plant, 20.0)
    assert np.allclose(superset(plant).simulate(recording, {}, None), simulate(plant, recording, None), atol=1e-13)


def test_every_candidate_starts_and_runs() -> None:
    plant = motor("speed_rad_s", "current_A")
    recording, whole = driven(plant, 8.0), superset(plant)
    for effect in candidates(plant):
        for use in [use for use in all_uses(plant) if use.name == effect.name]:
            for start in starts_of(plant, [recording], use.name, use.output):
                assert set(start) <= set(whole.names)
                assert np.all(np.isfinite(whole.simulate(recording, start, None))), start


@pytest.mark.parametrize(
    ("parameters", "name"),
    [
        ({"coulomb_friction.torque_N_m": 2e-3}, "coulomb_friction.torque_N_m"),
        ({"cogging_torque.amplitude_N_m": 2e-3, "cogging_torque.periods_per_rev": 3.0}, "cogging_torque.phase_rad"),
        ({"input_delay.delay_s": 1.3e-3}, "input_delay.delay_s"),
        ({"sensor_lag.current_A.time_constant_s": 2e-3}, "sensor_lag.current_A.time_constant_s"),
        ({"load_torque.torque_N_m": 1e-3}, "J_kg_m2"),
        ({"torque_constant_saturation.current_A": 1.0}, "torque_constant_saturation.current_A"),
    ],
)
def test_slopes_are_those_of_wider_differences(parameters: dict[str, float], name: str) -> None:
    plant = motor("speed_rad_s", "current_A")
    recording, whole = driven(plant, 8.0, rows=300), superset(plant)
    slope = whole.slopes(recording, parameters, [name, "start.speed_rad_s"], None)[..., 0]
    value = parameters.get(name, whole.neutral[name])
    step = 1e-4 * (abs(value) or 1.0)
    ends = [whole.simulate(recording, {**parameters, name: value + way * step}, None) for way in (1.0, -1.0)]
    wide = (ends[0] - ends[1]) / (2.0 * step)
    # Where a friction turns round within the wide difference the slope itself bends.
    assert np.median(np.abs(slope - wide)) <= 1e-4 * np.abs(wide).max()


def test_friction_holds_the_shaft() -> None:
    plant = with_effects(motor("speed_rad_s"), [EffectUse("coulomb_friction", None, {"torque_N_m": 5e-3})])
    time = np.arange(400) * 1e-3
    voltage = np.where(time < 0.2, 4.0, 1.0)  # 1 V gives 2.5 mN m, half of what would be needed
    recording = make_recording(time, {"voltage_V": voltage, "speed_rad_s": time}, "stop", "")
    speed = simulate(plant, recording, None)[:, 0]
    assert speed[190] > 20.0
    assert np.all(speed[-50:] == 0.0)


def test_a_fit_finds_friction_and_load() -> None:
    uses = [
        EffectUse("coulomb_friction", None, {"torque_N_m": 1e-3}, ("torque_N_m",)),
        EffectUse("sensor_offset", "current_A", {"offset_A": 0.05}, ("offset_A",)),
    ]
    true = with_effects(motor("speed_rad_s", "current_A"), uses)
    recording = driven(true, 8.0)
    noisy = {
        name: values + np.random.default_rng(5).normal(size=len(values)) * {"speed_rad_s": 0.5, "current_A": 0.01}[name]
        for name, values in recording.columns.items()
        if name != "voltage_V"
    }
    seen = make_recording(recording.time, {**recording.columns, **noisy}, "noisy", "")
    off = replace(true, parameters=tuple(replace(p, value=1.08 * p.value) if p.free else p for p in true.parameters))
    found = fit(off, [seen], [], NONE).plant
    for parameter, truth in zip(found.parameters, true.parameters, strict=True):
        if truth.free:
            assert parameter.deviation is not None
            assert abs(parameter.value - truth.value) < 5.0 * parameter.deviation, parameter.name
            assert parameter.deviation < 0.1 * abs(truth.value), parameter.name


def test_linear_keeps_what_has_a_slope() -> None:
    bare = linearize(motor("position_rad"))
    uses = [
        EffectUse("coulomb_friction", None, {"torque_N_m": 1e-3}),
        EffectUse("return_spring", None, {"stiffness_N_m_rad": 0.01}),
        EffectUse("gravity_torque", None, {"amplitude_N_m": 0.02, "phase_rad": 0.0}),
        EffectUse("dead_zone", None, {"half_width_V": 1.0}),
        EffectUse("input_delay", None, {"delay_s": 2e-3}),
        EffectUse("sensor_gain", None, {"gain": 1.1}),
    ]
    shown = linearize(with_effects(motor("position_rad"), uses))
    expected = bare.a.copy()
    expected[1, 2] -= (0.01 + 0.02) / MOTOR["J_kg_m2"]
    assert np.allclose(shown.a, expected, rtol=1e-6, atol=1e-6)
    assert np.allclose(shown.b, bare.b)
    assert np.allclose(shown.c, 1.1 * bare.c)
    assert shown.delay == 2e-3


def test_linear_without_inductance_stays_small() -> None:
    bare = motor("speed_rad_s", inductance=0.0)
    shown = linearize(with_effects(bare, [EffectUse("supply_sag", None, {"source_ohm": 2.0})]))
    sagging = {**MOTOR, "R_ohm": 10.0, "L_H": 0.0}
    given = {name: {"value": value, "free": name != "L_H"} for name, value in sagging.items()}
    same = linearize(make_plant("dc_motor", "voltage_V", ["speed_rad_s"], given))
    assert np.allclose(shown.a, same.a, rtol=1e-5)
    assert np.allclose(shown.b, same.b, rtol=1e-5)


def test_names_follow_the_plant() -> None:
    assert [p.name for p in parameters_of(stage(), "coulomb_friction")] == ["force_N"]
    assert [p.name for p in parameters_of(stage(), "stribeck_friction")] == ["coulomb_N", "static_N", "stribeck_m_s"]
    assert [p.name for p in parameters_of(stage("motor_V"), "dead_zone")] == ["half_width_V"]
    assert [p.name for p in parameters_of(motor("current_A"), "sensor_wrap", "current_A")] == ["range_A", "start"]
    assert "gravity_torque" not in {effect.name for effect in candidates(stage())}
    assert "brush_drop" not in {effect.name for effect in candidates(stage())}


def test_a_named_drive_signal_is_scaled() -> None:
    recording = driven(stage(), 20.0)
    scaled = make_recording(
        recording.time,
        {"motor_V": recording.columns["force_N"] / 3.0, "position_m": recording.columns["position_m"]},
        "volts",
        "",
    )
    assert np.allclose(simulate(stage("motor_V"), scaled, None), simulate(stage(), recording, None), atol=1e-12)
    with pytest.raises(IdentifyError, match="force_per_unit"):
        make_plant("linear_stage", "motor_V", ["position_m"], STAGE)


@pytest.mark.parametrize(
    ("entry", "said"),
    [
        ({"name": "coulomb"}, "did you mean coulomb_friction"),
        ({"name": "coulomb_friction"}, "torque_N_m is missing"),
        ({"name": "coulomb_friction", "force_N": 1.0}, "force_N is unknown"),
        ({"name": "coulomb_friction", "torque_N_m": -1.0}, "must lie within"),
        ({"name": "coulomb_friction", "torque_N_m": "much"}, "must be a number"),
        ({"name": "sensor_offset", "output": "position_m", "offset_m": 1.0}, "no output of the plant"),
        ({"name": "overflow", "level": 1.0}, "needs a flow"),
    ],
)
def test_wrong_effects_are_named(entry: dict[str, object], said: str) -> None:
    table = {"kind": "dc_motor", "input": "voltage_V", "outputs": ["speed_rad_s"], "parameters": MOTOR}
    with pytest.raises(IdentifyError, match=said):
        plant_from_table({**table, "effects": [entry]})


PROJECT = """schema = 1
name = "wheel"
[recordings]
train = ["run.csv"]
[plant]
kind = "dc_motor"
input = "voltage_V"
outputs = ["speed_rad_s", "current_A"]
[plant.parameters]
R_ohm = { value = 8.0, free = true }
L_H = { value = 1e-3, free = false }
ke_V_s_rad = { value = 0.02, free = true }
kt_N_m_A = { value = 0.02, free = false }
J_kg_m2 = { value = 3e-6, free = true }
b_N_m_s_rad = { value = 3e-6, free = true }
[[plant.effects]]
name = "coulomb_friction"
torque_N_m = { value = 1.1e-3, free = true }
[[plant.effects]]
name = "sensor_offset"
output = "current_A"
offset_A = 0.01
"""


def test_a_project_keeps_its_effects(tmp_path: Path) -> None:
    (tmp_path / "wheel.toml").write_text(PROJECT, encoding="utf-8")
    plant = plant_from_table(tomllib.loads(PROJECT)["plant"])
    write_recording(driven(plant, 8.0), tmp_path / "run.csv")
    assert main(["identify", str(tmp_path / "wheel.toml"), "--out", str(tmp_path / "out")]) == 0
    fitted = tomllib.loads((tmp_path / "out" / "project.toml").read_text(encoding="utf-8"))["plant"]
    again = plant_from_table(fitted)
    assert [use.name for use in again.effects] == ["coulomb_friction", "sensor_offset"]
    held = {parameter.name: parameter for parameter in again.parameters}
    assert held["coulomb_friction.torque_N_m"].value == pytest.approx(1.1e-3, rel=1e-6)
    assert held["coulomb_friction.torque_N_m"].free
    assert held["sensor_offset.current_A.offset_A"].value == 0.01
    assert effects_table(again)[1] == {"name": "sensor_offset", "output": "current_A", "offset_A": 0.01}
    for extra in ([], ["--fit-initial"]):
        shown = tmp_path / f"shown{len(extra)}.csv"
        arguments = ["simulate", str(tmp_path / "out" / "project.toml"), str(tmp_path / "run.csv"), "--out", str(shown)]
        assert main([*arguments, *extra]) == 0
        first = np.loadtxt(tmp_path / "run.csv", delimiter=",", skiprows=1)
        assert np.allclose(np.loadtxt(shown, delimiter=",", skiprows=1), first, atol=1e-3)


def test_the_start_is_the_first_recorded_position() -> None:
    plant = with_effects(stage(), [EffectUse("coulomb_friction", None, {"force_N": 1.0})])
    time = np.arange(5) * 1e-3
    recording = make_recording(time, {"force_N": np.zeros(5), "position_m": time + 0.25}, "rest", "")
    assert rest_start(plant, recording)[-1] == 0.25
    assert np.all(simulate(plant, recording, None) == 0.25)


def test_find_effect_says_what_is_called_alike() -> None:
    with pytest.raises(IdentifyError, match="coulomb_friction"):
        find_effect("friction")

"""What differs from file to file: loads, zeros, gains and parameters that `per_recording` lists, through every verb."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pytest

from firmloop.cli import main
from firmloop.identify.plants.attach import with_effects
from firmloop.identify.plants.kinds import make_plant
from firmloop.identify.plants.plant import EffectUse
from firmloop.identify.recordings.recording import make_recording, write_recording
from firmloop.identify.simulation.simulate import simulate
from tests.diagnose.cases import said_of

MOTOR = {"R_ohm": 2.0, "L_H": 1e-3, "ke_V_s_rad": 0.05, "kt_N_m_A": 0.05, "J_kg_m2": 5e-5, "b_N_m_s_rad": 2e-5}
ROTOR = {key: {"value": MOTOR[key], "free": True} for key in ("J_kg_m2", "b_N_m_s_rad")}
NOISE = {"speed_rad_s": 0.3, "position_rad": 0.002, "current_A": 0.01}


def record(
    folder: Path,
    name: str,
    outputs: Sequence[str],
    effects: Sequence[EffectUse],
    seed: int,
    changed: Mapping[str, float] | None = None,
    drive: np.ndarray | None = None,
    start: np.ndarray | None = None,
) -> None:
    """Leave a recording of a motor at random steps, 1200 rows at 1 ms, with white noise."""
    random = np.random.default_rng(seed)
    values = {key: {"value": value, "free": True} for key, value in {**MOTOR, **(changed or {})}.items()}
    plant = with_effects(make_plant("dc_motor", "voltage_V", list(outputs), values), effects)
    time = np.arange(1200) * 1e-3
    voltage = np.repeat(random.uniform(-8.0, 8.0, 24), 50) if drive is None else drive
    still = {each: np.zeros(len(time)) for each in outputs}
    shown = simulate(plant, make_recording(time, {"voltage_V": voltage, **still}, name, ""), start)
    seen = {each: shown[:, k] + NOISE[each] * random.normal(size=len(time)) for k, each in enumerate(outputs)}
    write_recording(make_recording(time, {"voltage_V": voltage, **seen}, name, ""), folder / name)


def project(
    folder: Path,
    outputs: Sequence[str],
    listed: Sequence[str],
    train: Sequence[str],
    test: Sequence[str] = (),
    more: str = "",
) -> Path:
    """Leave a project whose values are 4 % off."""
    given = "\n".join(f"{key} = {{ value = {1.04 * value:.6g}, free = true }}" for key, value in MOTOR.items())
    text = f"""schema = 1
name = "own"
[recordings]
train = {json.dumps(list(train))}
test = {json.dumps(list(test))}
per_recording = {json.dumps(list(listed))}
[plant]
kind = "dc_motor"
input = "voltage_V"
outputs = {json.dumps(list(outputs))}
[plant.parameters]
{given.replace("kt_N_m_A = { value = 0.052, free = true }", "kt_N_m_A = { value = 0.05, free = false }")}
"""
    path = folder / "project.toml"
    path.write_text(text)
    return path


def coasting(
    folder: Path,
    name: str,
    effects: Sequence[EffectUse],
    seed: int,
    drive: np.ndarray,
    speed: float,
    outputs: Sequence[str] = ("speed_rad_s",),
) -> None:
    """Leave a recording of a rotor that a torque drives, from a speed on."""
    random = np.random.default_rng(seed)
    plant = with_effects(make_plant("rotary_stage", "torque_N_m", list(outputs), ROTOR), effects)
    time = np.arange(len(drive)) * 1e-3
    still = {each: np.zeros(len(time)) for each in outputs}
    start = np.zeros(len(plant.states))
    start[[state.name for state in plant.states].index("speed_rad_s")] = speed
    shown = simulate(plant, make_recording(time, {"torque_N_m": drive, **still}, name, ""), start)
    seen = {each: shown[:, k] + NOISE[each] * random.normal(size=len(time)) for k, each in enumerate(outputs)}
    write_recording(make_recording(time, {"torque_N_m": drive, **seen}, name, ""), folder / name)


def coasting_project(folder: Path, train: Sequence[str], outputs: Sequence[str] = ("speed_rad_s",)) -> Path:
    """Leave a project of that rotor; its inertia is known."""
    path = folder / "project.toml"
    path.write_text(f"""schema = 1
name = "coasting"
[recordings]
train = {json.dumps(list(train))}
[plant]
kind = "rotary_stage"
input = "torque_N_m"
outputs = {json.dumps(list(outputs))}
[plant.parameters]
J_kg_m2 = {{ value = 5e-5, free = false }}
b_N_m_s_rad = {{ value = 2.1e-5, free = true }}
""")
    return path


def load(torque: float) -> EffectUse:
    """A constant load."""
    return EffectUse("load_torque", None, {"torque_N_m": torque})


def zero(output: str, offset: float) -> EffectUse:
    """A sensor's zero that is off."""
    return EffectUse("sensor_offset", output, {f"offset_{output.partition('_')[2]}": offset})


def told(capsys: pytest.CaptureFixture[str], *arguments: object) -> tuple[int, dict]:
    """Run a command; return its code and its JSON, or what it complained of."""
    code = main([*map(str, arguments), "--json"])
    shown = capsys.readouterr()
    return code, {"error": shown.err, **(json.loads(shown.out) if code in (0, 1) else {})}


LOADS = {"a.csv": 0.004, "b.csv": -0.006, "c.csv": 0.011}


def test_identify_tells_the_load_and_the_zero_of_every_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    outputs = ("speed_rad_s", "current_A")
    for k, (name, torque) in enumerate(LOADS.items()):
        record(tmp_path, name, outputs, [load(torque), zero("speed_rad_s", 3.0 * k)], k)
    path = project(tmp_path, outputs, ["load_torque_N_m", "zero.speed_rad_s"], ["a.csv", "b.csv"], ["c.csv"])
    code, said = told(capsys, "identify", path, "--out", tmp_path / "out")
    assert code == 0
    own = said["plant"]["per_recording"]
    for k, (name, torque) in enumerate(LOADS.items()):
        for value, listed in ((torque, "load_torque_N_m"), (3.0 * k, "zero.speed_rad_s")):
            low, high = own[listed][name]["ci95"]
            reach = 0.5 * (high - low)
            assert abs(own[listed][name]["value"] - value) < 3.0 * reach, (listed, name)
            assert reach < 0.01 * max(abs(value), 5.0 if "zero" in listed else 0.01)
    assert own["load_torque_N_m"]["a.csv"]["unit"] == "N*m"
    for key, value in MOTOR.items():
        assert said["plant"]["parameters"][key]["value"] == pytest.approx(value, rel=0.05)
    assert said["plant"]["parameters"]["load_torque.torque_N_m"]["value"] == pytest.approx(-0.001, abs=1e-4)
    # The written project holds the mean of the train files, keeps the list, and is a project for the next verb.
    text = (tmp_path / "out" / "project.toml").read_text()
    assert 'per_recording = ["load_torque_N_m", "zero.speed_rad_s"]' in text
    assert 'name = "load_torque"' in text and 'name = "sensor_offset"' in text
    made = tmp_path / "c_simulated.csv"
    assert main(["simulate", str(tmp_path / "out" / "project.toml"), str(tmp_path / "c.csv"), "--out", str(made)]) == 0
    assert "load_torque_N_m is 0.01" in capsys.readouterr().out
    measured, simulated = (np.genfromtxt(each, delimiter=",", names=True) for each in (tmp_path / "c.csv", made))
    assert np.std(measured["speed_rad_s"] - simulated["speed_rad_s"]) < 1.1 * NOISE["speed_rad_s"]
    assert abs(np.mean(measured["speed_rad_s"] - simulated["speed_rad_s"])) < 0.1


def test_a_parameter_and_a_gain_of_every_file_are_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    outputs = ("speed_rad_s", "current_A")
    for k, (inertia, gain) in enumerate(((5e-5, 1.0), (8e-5, 1.1))):
        scaled = EffectUse("sensor_gain", "current_A", {"gain": gain})
        record(tmp_path, f"{k}.csv", outputs, [scaled], k, {"J_kg_m2": inertia})
    path = project(tmp_path, outputs, ["J_kg_m2", "gain.current_A"], ["0.csv", "1.csv"])
    path.write_text(
        path.read_text().replace("R_ohm = { value = 2.08, free = true }", "R_ohm = { value = 2.0, free = false }")
    )
    code, said = told(capsys, "identify", path, "--out", tmp_path / "out")
    assert code == 0
    own = said["plant"]["per_recording"]
    ratio = own["gain.current_A"]["1.csv"]["value"] / own["gain.current_A"]["0.csv"]["value"]
    assert ratio == pytest.approx(1.1, rel=0.005)
    heavier = own["J_kg_m2"]["1.csv"]["value"] / own["J_kg_m2"]["0.csv"]["value"]
    assert heavier == pytest.approx(1.6, rel=0.01)
    assert "J_kg_m2 = { value" in (text := (tmp_path / "out" / "project.toml").read_text())
    assert next(line for line in text.splitlines() if line.startswith("J_kg_m2")).find("free = true") > 0


@pytest.mark.parametrize(
    ("listed", "says"),
    [
        ("load_torque", "did you mean 'load_torque_N_m'"),
        ("zero.force_N", "zero.speed_rad_s"),
        ("windage", "J_kg_m2"),
    ],
)
def test_a_name_that_no_plant_has_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], listed: str, says: str
) -> None:
    record(tmp_path, "a.csv", ["speed_rad_s"], [], 1)
    path = project(tmp_path, ["speed_rad_s"], [listed], ["a.csv"])
    code, said = told(capsys, "identify", path, "--out", tmp_path / "out")
    assert code == 2
    assert f"recordings.per_recording names '{listed}'" in said["error"] and says in said["error"]
    assert "load_torque_N_m" in said["error"] and "zero.speed_rad_s" in said["error"]


def test_loads_that_differ_are_no_missing_physics(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    outputs = ("speed_rad_s", "current_A")
    for k, (name, torque) in enumerate(LOADS.items()):
        record(tmp_path, name, outputs, [load(torque)], k)
    path = project(tmp_path, outputs, ["load_torque_N_m"], list(LOADS))
    code, said = told(capsys, "diagnose", path, "--out", tmp_path / "out")
    assert code == 0, said
    for name, torque in LOADS.items():
        assert said["per_recording"]["load_torque_N_m"][name]["value"] == pytest.approx(torque, abs=3e-4)


def test_friction_is_found_beside_loads_that_differ(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    outputs, friction = ("speed_rad_s", "current_A"), EffectUse("coulomb_friction", None, {"torque_N_m": 0.01})
    for k, torque in enumerate((0.004, -0.006)):
        record(tmp_path, f"{k}.csv", outputs, [load(torque), friction], k)
    path = project(tmp_path, outputs, ["load_torque_N_m"], ["0.csv", "1.csv"])
    code, said = told(capsys, "diagnose", path, "--out", tmp_path / "out")
    assert code == 1, said
    assert [each["name"] for each in said["effects"]] == ["coulomb_friction"], said["says"]
    assert said["effects"][0]["parameters"]["torque_N_m"]["value"] == pytest.approx(0.01, rel=0.05)
    text = (tmp_path / "out" / "project.toml").read_text()
    assert 'per_recording = ["load_torque_N_m"]' in text and 'name = "load_torque"' in text


def test_a_late_sensor_is_found_beside_a_zero_of_every_run(tmp_path: Path) -> None:
    late = EffectUse("sensor_delay", "speed_rad_s", {"delay_s": 0.004})
    for k, offset in enumerate((5.0, -3.0)):
        record(tmp_path, f"{k}.csv", ["speed_rad_s", "current_A"], [late, zero("speed_rad_s", offset)], k)
    path = project(tmp_path, ["speed_rad_s", "current_A"], ["zero.speed_rad_s"], ["0.csv", "1.csv"])
    said = said_of(path)
    assert [each["name"] for each in said["effects"]] == ["sensor_delay"], said["says"]
    assert said["effects"][0]["parameters"]["delay_s"]["value"] == pytest.approx(0.004, rel=0.03)
    values = said["per_recording"]["zero.speed_rad_s"]
    assert values["0.csv"]["value"] - values["1.csv"]["value"] == pytest.approx(8.0, abs=0.1)


def test_a_free_decay_tells_friction(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    friction = EffectUse("coulomb_friction", None, {"torque_N_m": 0.004})
    for k, speed in enumerate((120.0, -90.0)):
        values = np.zeros(1200)
        coasting(tmp_path, f"{k}.csv", [friction], k, values, speed)
    path = coasting_project(tmp_path, ["0.csv", "1.csv"])
    code, said = told(capsys, "identify", path, "--out", tmp_path / "fit")
    assert code == 0
    assert "b_N_m_s_rad" in said["plant"]["parameters"]
    said = said_of(path)
    assert "coulomb_friction" in [each["name"] for each in said["effects"]], said["says"]


def test_a_constant_speed_tells_what_repeats_per_turn(tmp_path: Path) -> None:
    """At a constant drive the shaft turns at a constant speed but for its ripple."""
    outputs = ("position_rad", "speed_rad_s")
    cogging = EffectUse("cogging_torque", None, {"amplitude_N_m": 2e-3, "periods_per_rev": 6.0, "phase_rad": 0.5})
    coasting(tmp_path, "0.csv", [cogging], 0, np.full(1200, 30.0 * MOTOR["b_N_m_s_rad"]), 30.0, outputs)
    path = coasting_project(tmp_path, ["0.csv"], outputs)
    said = said_of(path)
    assert [each["name"] for each in said["effects"]] == ["cogging_torque"], said["says"]
    assert said["effects"][0]["parameters"]["amplitude_N_m"]["value"] == pytest.approx(2e-3, rel=0.1)
    assert said["effects"][0]["parameters"]["periods_per_rev"]["value"] == pytest.approx(6.0, rel=1e-3)
    assert any("in every row" in note for note in said["notes"])


def test_a_constant_speed_is_simulated_in_the_turn_it_begins_in(tmp_path: Path) -> None:
    """At a constant drive the shaft turns at a constant speed but for its ripple, and was not at rest before."""
    outputs = ("position_rad", "speed_rad_s")
    cogging = EffectUse("cogging_torque", None, {"amplitude_N_m": 2e-3, "periods_per_rev": 6.0, "phase_rad": 0.5})
    coasting(tmp_path, "0.csv", [cogging], 0, np.full(1200, 30.0 * MOTOR["b_N_m_s_rad"]), 30.0, outputs)
    path = coasting_project(tmp_path, ["0.csv"], outputs)
    more = "\n".join(f"{key} = {value}" for key, value in cogging.values.items())
    given = path.read_text().replace("2.1e-5", "2e-5")
    path.write_text(f'{given}\n[[plant.effects]]\nname = "cogging_torque"\n{more}\n')
    made = tmp_path / "simulated.csv"
    for how in ([], ["--fit-initial"]):
        assert main(["simulate", str(path), str(tmp_path / "0.csv"), "--out", str(made), *how]) == 0
        measured, simulated = (np.genfromtxt(each, delimiter=",", names=True) for each in (tmp_path / "0.csv", made))
        for output in outputs:
            assert np.sqrt(np.mean((measured[output] - simulated[output]) ** 2)) < 1.1 * NOISE[output]


def test_a_zero_that_nothing_tells_has_no_interval(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A zero of the only position is where the recording begins."""
    for k in range(2):
        coasting(tmp_path, f"{k}.csv", [], k, np.repeat([1e-3, -1e-3, 2e-3], 400), 0.0, ("position_rad",))
    path = coasting_project(tmp_path, ["0.csv", "1.csv"], ("position_rad",))
    path.write_text(path.read_text().replace("[plant]", 'per_recording = ["zero.position_rad"]\n[plant]', 1))
    code, said = told(capsys, "identify", path, "--out", tmp_path / "out")
    assert code == 0, said
    assert all(each["ci95"] is None for each in said["plant"]["per_recording"]["zero.position_rad"].values())
    assert said["plant"]["parameters"]["b_N_m_s_rad"]["value"] == pytest.approx(MOTOR["b_N_m_s_rad"], rel=0.05)

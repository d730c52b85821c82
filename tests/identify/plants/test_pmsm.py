"""A permanent-magnet machine against SciPy's fine steps, and its constants out of noisy recordings."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from firmloop.cli import main
from firmloop.identify.error import IdentifyError
from firmloop.identify.fitting.fit import fit
from firmloop.identify.plants.kinds import make_plant
from firmloop.identify.plants.plant_table import plant_from_table
from firmloop.identify.recordings.conditioning import NONE
from firmloop.identify.recordings.recording import Recording, make_recording
from firmloop.identify.simulation.simulate import simulate
from firmloop.project.project import read_project

Array = NDArray[np.float64]

VALUES = {"R_ohm": 0.36, "Ld_H": 0.2e-3, "Lq_H": 0.33e-3, "flux_Wb": 6.4e-3, "J_kg_m2": 4.8e-6, "b_N_m_s_rad": 1e-5}
MACHINE: Mapping[str, object] = {**VALUES, "pole_pairs": 4}
OUTPUTS = ("current_d_A", "current_q_A", "current_a_A", "current_b_A", "speed_rad_s", "position_rad")
DQ = ("voltage_d_V", "voltage_q_V")
STEP = 1e-4


def voltages(rows: int, seed: int) -> dict[str, Array]:
    """Levels that are held for some milliseconds: forward, back and across."""
    random = np.random.default_rng(seed)
    held = np.repeat(random.uniform(-1.0, 1.0, (rows // 40 + 1, 2)), 40, axis=0)[:rows]
    return {"voltage_d_V": 1.5 * held[:, 0], "voltage_q_V": 6.0 * held[:, 1]}


def rates(x: Array, v_d: float, v_q: float, load: float = 0.0, dead: float = 0.0) -> list[float]:
    """Write the machine a second time, from its flux linkages; what the bridges lose as a vector of the stator."""
    i_d, i_q, w, th = x
    vector, phases = (i_d + 1j * i_q) * np.exp(4j * th), np.exp(2j * math.pi / 3 * np.arange(3))
    flowing = (vector * phases.conj()).real
    steep = (0.1 * dead / VALUES["R_ohm"]) ** 2 + 1e-24
    lost = 2 / 3 * np.sum(dead * flowing / np.sqrt(flowing**2 + steep) * phases) * np.exp(-4j * th)
    v_d, v_q = v_d - lost.real, v_q - lost.imag
    flux_d, flux_q, electric = VALUES["Ld_H"] * i_d + VALUES["flux_Wb"], VALUES["Lq_H"] * i_q, 4 * w
    torque = 1.5 * 4 * (flux_d * i_q - flux_q * i_d)
    return [
        (v_d - VALUES["R_ohm"] * i_d + electric * flux_q) / VALUES["Ld_H"],
        (v_q - VALUES["R_ohm"] * i_q - electric * flux_d) / VALUES["Lq_H"],
        (torque - VALUES["b_N_m_s_rad"] * w - load) / VALUES["J_kg_m2"],
        w,
    ]


def fine(drives: tuple[Array, Array], load: float = 0.0, dead: float = 0.0, step: float = STEP) -> Array:
    """Return what all outputs show, row by row."""
    x, states = np.zeros(4), []
    for v_d, v_q in zip(*drives, strict=True):
        states.append(x)
        done = solve_ivp(
            lambda t, x, v_d=v_d, v_q=v_q: rates(x, v_d, v_q, load, dead),
            (0.0, step),
            x,
            "DOP853",
            rtol=1e-10,
            atol=1e-12,
        )
        x = done.y[:, -1]
    i_d, i_q, w, th = np.array(states).T
    phases = [np.cos(4 * th - late) * i_d - np.sin(4 * th - late) * i_q for late in (0.0, 2 * math.pi / 3)]
    return np.column_stack([i_d, i_q, *phases, w, th])


def apart(shown: Array, truth: Array) -> float:
    """Return the largest distance, as a share of what the output reaches."""
    return float(np.max(np.abs(shown - truth) / np.max(np.abs(truth), axis=0)))


def recorded(columns: Mapping[str, Array], step: float = STEP) -> Recording:
    time = np.arange(len(next(iter(columns.values())))) * step
    return make_recording(time, dict(columns), "drawn", "")


def test_it_turns_as_fine_steps_say() -> None:
    drive = voltages(800, 3)
    shown = simulate(make_plant("pmsm", DQ, OUTPUTS, MACHINE), recorded(drive), None)
    truth = fine((drive["voltage_d_V"], drive["voltage_q_V"]))
    assert np.max(np.abs(truth[:, 4])) > 100.0 and np.max(np.abs(truth[:, 5])) > math.pi / 2
    assert apart(shown, truth) < 1e-6


def test_it_turns_fast_between_rows_far_apart() -> None:
    """At a millisecond a row the electrical angle goes on by two radians: the steps follow the speed."""
    drive = {"voltage_d_V": np.zeros(300), "voltage_q_V": np.full(300, 14.0)}
    shown = simulate(make_plant("pmsm", DQ, OUTPUTS, MACHINE), recorded(drive, 1e-3), None)
    truth = fine((drive["voltage_d_V"], drive["voltage_q_V"]), step=1e-3)
    assert 4 * truth[-1, 4] * 1e-3 > 1.9
    assert apart(shown, truth) < 1e-6


def test_duties_are_voltages_at_the_measured_angle() -> None:
    """What three half bridges give along d and q; what they have in common moves nothing."""
    rows = 400
    drive = voltages(rows, 5)
    angle, supply = np.linspace(0.0, 20.0, rows), np.full(rows, 24.0)
    columns: dict[str, Array] = {"angle_rad": angle, "supply_V": supply}
    for k, phase in enumerate("abc"):
        at = angle - k * 2 * math.pi / 3
        wave = np.cos(at) * drive["voltage_d_V"] - np.sin(at) * drive["voltage_q_V"]
        columns[f"duty_{phase}"] = 0.47 + wave / supply
    inputs = ("duty_a", "duty_b", "duty_c", "supply_V", "angle_rad")
    by_duty = simulate(make_plant("pmsm", inputs, OUTPUTS[:2], MACHINE), recorded(columns), None)
    by_voltage = simulate(make_plant("pmsm", DQ, OUTPUTS[:2], MACHINE), recorded(drive), None)
    np.testing.assert_allclose(by_duty, by_voltage, atol=1e-8)


def test_effects_of_the_shaft_attach() -> None:
    """A load in fine steps too; cogging, ripple and friction change what they should."""
    drive = voltages(400, 7)
    table = {"kind": "pmsm", "inputs": list(DQ), "outputs": list(OUTPUTS), "parameters": MACHINE}

    def shown(*effects: Mapping[str, object]) -> Array:
        return simulate(plant_from_table({**table, "effects": list(effects)}), recorded(drive), None)

    loaded = shown({"name": "load_torque", "torque_N_m": 0.004})
    truth = fine((drive["voltage_d_V"], drive["voltage_q_V"]), load=0.004)
    assert apart(loaded, truth) < 1e-6
    free = shown()
    for effect in (
        {"name": "coulomb_friction", "torque_N_m": 0.003},
        {"name": "cogging_torque", "amplitude_N_m": 0.004, "periods_per_rev": 24.0, "phase_rad": 0.3},
        {"name": "torque_ripple", "ratio": 0.1, "periods_per_rev": 24.0, "phase_rad": 0.3},
        {"name": "sensor_offset", "output": "current_a_A", "offset_A": 0.2},
    ):
        assert np.max(np.abs(shown(effect) - free)) > 0.1, effect["name"]


def test_the_dead_time_of_its_inverter_is_simulated_and_found() -> None:
    """Against fine steps; then from the phases' currents, with noise, beside R that it is easily taken for."""
    drive = voltages(1000, 9)
    table = {"kind": "pmsm", "inputs": list(DQ), "outputs": list(OUTPUTS)}
    effect = {"name": "dead_time", "voltage_V": 0.3}
    shown = simulate(plant_from_table({**table, "parameters": MACHINE, "effects": [effect]}), recorded(drive), None)
    truth = fine((drive["voltage_d_V"], drive["voltage_q_V"]), dead=0.3)
    assert apart(shown, truth) < 1e-3
    assert apart(fine((drive["voltage_d_V"], drive["voltage_q_V"])), truth) > 0.03

    wide = np.array([0.05, 0.05, 0.05, 0.05, 1.0, 1e-3])
    noisy = truth + np.random.default_rng(6).normal(size=truth.shape) * wide
    recording = recorded({**drive, **dict(zip(OUTPUTS, noisy.T, strict=True))})
    held = {name: {"value": value, "free": name == "R_ohm"} for name, value in VALUES.items()}
    free = {"name": "dead_time", "voltage_V": {"value": 0.1, "free": True}}
    asked = {**held, "R_ohm": {"value": 0.5, "free": True}, "pole_pairs": 4}
    found = fit(plant_from_table({**table, "parameters": asked, "effects": [free]}), [recording], [], NONE)
    values = {p.name: p for p in found.plant.parameters}
    for name, right in (("dead_time.voltage_V", 0.3), ("R_ohm", VALUES["R_ohm"])):
        assert values[name].value == pytest.approx(right, rel=0.02), name
    unseen = {**table, "outputs": ["speed_rad_s"], "parameters": MACHINE, "effects": [effect]}
    with pytest.raises(IdentifyError, match="dead_time needs a bridge of the plant, and pmsm has none"):
        plant_from_table(unseen)


def test_its_constants_are_found_from_far_away() -> None:
    """From starts 40 % off, with noise on every reading: each true value within three deviations, none wide."""
    wires = ("current_d_A", "current_q_A", "speed_rad_s")
    drive = voltages(2000, 11)
    truth = simulate(make_plant("pmsm", DQ, wires, MACHINE), recorded(drive), None)
    noisy = truth + np.random.default_rng(4).normal(size=truth.shape) * (0.05, 0.05, 1.0)
    recording = recorded({**drive, **dict(zip(wires, noisy.T, strict=True))})
    off = (1.4, 0.7, 1.3, 0.75, 1.4, 1.5)
    given = {name: value * times for (name, value), times in zip(VALUES.items(), off, strict=True)}
    found = fit(make_plant("pmsm", DQ, wires, {**given, "pole_pairs": 4}), [recording], [], NONE)
    assert found.noise["current_q_A"] == pytest.approx(0.05, rel=0.1)
    for parameter in found.plant.parameters:
        if parameter.name == "pole_pairs":
            assert (parameter.value, parameter.free, parameter.deviation) == (4.0, False, None)
            continue
        assert parameter.deviation is not None
        wide = 0.03 if parameter.name != "b_N_m_s_rad" else 0.3
        assert abs(parameter.value - VALUES[parameter.name]) < 3.5 * parameter.deviation < wide * parameter.value


PROJECT = """schema = 1
name = "spindle"
[recordings]
train = ["steps.csv"]
[plant]
kind = "pmsm"
inputs = ["voltage_d_V", "voltage_q_V"]
outputs = ["current_d_A", "current_q_A", "speed_rad_s"]
[plant.parameters]
R_ohm = 0.5
Ld_H = 2e-4
Lq_H = 2e-4
flux_Wb = 5e-3
pole_pairs = 4
J_kg_m2 = 6e-6
b_N_m_s_rad = 1e-5
"""


def test_identify_takes_its_project_and_gives_it_back(tmp_path: Path) -> None:
    wires = ("current_d_A", "current_q_A", "speed_rad_s")
    drive = voltages(1200, 11)
    truth = simulate(make_plant("pmsm", DQ, wires, MACHINE), recorded(drive), None)
    noisy = truth + np.random.default_rng(4).normal(size=truth.shape) * (0.05, 0.05, 1.0)
    table = np.column_stack([np.arange(len(truth)) * STEP, *drive.values(), noisy])
    header = ",".join(("time_s", *drive, *wires))
    np.savetxt(tmp_path / "steps.csv", table, delimiter=",", header=header, comments="", fmt="%.9g")
    (tmp_path / "spindle.toml").write_text(PROJECT)
    assert main(["identify", str(tmp_path / "spindle.toml"), "--out", str(tmp_path / "out")]) == 0
    (written,) = (tmp_path / "out").glob("*.toml")
    part = read_project(written).plant
    assert part is not None
    values = {parameter.name: parameter.value for parameter in plant_from_table(part.table.values).parameters}
    assert values["pole_pairs"] == 4.0
    assert values["Lq_H"] == pytest.approx(VALUES["Lq_H"], rel=0.02)
    assert values["flux_Wb"] == pytest.approx(VALUES["flux_Wb"], rel=0.01)


@pytest.mark.parametrize(
    ("inputs", "changed", "words"),
    [
        (("voltage_q_V", "voltage_d_V"), {}, r"plant.inputs \['voltage_q_V', 'voltage_d_V'\]: pmsm is driven by"),
        ("voltage_V", {}, r"plant.input 'voltage_V': pmsm is driven by inputs = \[voltage_d_V, voltage_q_V\] or"),
        (DQ, {"pole_pairs": {"value": 4, "free": True}}, "pole_pairs is counted; set free = false"),
        (DQ, {"pole_pairs": 3.5}, "pole_pairs.value is 3.5; it must be a whole number"),
        (DQ, {"pole_pairs": 0}, "must lie within 1 and 1000"),
        (DQ, {"flux_Wb": 0.0}, "flux_Wb.value is 0 Wb; it must be above 0"),
    ],
)
def test_what_is_wrong_is_named(inputs: object, changed: Mapping[str, object], words: str) -> None:
    with pytest.raises(IdentifyError, match=words):
        make_plant("pmsm", inputs, ["speed_rad_s"], {**MACHINE, **changed})

"""A log that no plant can have left is refused before a fit or a search that it would lead astray."""

from __future__ import annotations

import json

import numpy as np
import pytest

from bench.host.identify_faults import motor, stage
from firmloop.cli import main
from tests.firmloop.columns.test_identify_says import identified, logged, seeded, written
from tests.identify.fitting.test_three_phases import ROWS, VALUES, H
from tests.identify.fitting.test_three_phases import log as of_axes
from tests.identify.simulation.test_bridge_columns import INPUTS, STEP
from tests.identify.simulation.test_bridge_columns import log as of_bridges

AXES = ("voltage_d_V", "voltage_q_V", "current_d_A", "current_q_A", "speed_rad_s")
VERBS = pytest.mark.parametrize("verb", ["identify", "diagnose"])


def refused(verb, folder, capsys) -> str:
    status = main([verb, str(folder / "project.toml"), "--out", str(folder / "out")])
    said = capsys.readouterr().err
    assert status == 2 and not (folder / "out").exists(), said
    return said


def machine(folder, inputs, outputs, columns, step):
    logged(folder / "log.csv", step * np.arange(len(columns["speed_rad_s"])), columns)
    parameters = "".join(f"{name} = {{ value = {value!r}, free = true }}\n" for name, value in VALUES.items())
    (folder / "project.toml").write_text(
        f'schema = 1\nname = "drive"\n[recordings]\ntrain = ["log.csv"]\n[plant]\nkind = "pmsm"\n'
        f"inputs = {json.dumps(inputs)}\noutputs = {json.dumps(outputs)}\n[plant.parameters]\n{parameters}"
        "pole_pairs = 4\n"
    )
    return folder


SHOWN = {
    "exchanged": (lambda c: {"current_d_A": c["current_q_A"], "current_q_A": c["current_d_A"]}, "look exchanged"),
    "voltages exchanged": (
        lambda c: {"voltage_d_V": c["voltage_q_V"], "voltage_q_V": c["voltage_d_V"]},
        "voltage_d_V and voltage_q_V of log.csv look exchanged",
    ),
    "one turned": (lambda c: {"current_q_A": -c["current_q_A"]}, "current_q_A runs against voltage_q_V in log.csv"),
    "electrical speed": (lambda c: {"speed_rad_s": 4 * c["speed_rad_s"]}, "or speed_rad_s is the electrical speed"),
}


@VERBS
@pytest.mark.parametrize("case", SHOWN)
def test_currents_along_the_axes_that_contradict_the_voltages(case, verb, tmp_path, capsys):
    change, words = SHOWN[case]
    columns = {name: values for name, values in of_axes(4).items() if name in AXES}
    assert len(columns["speed_rad_s"]) == ROWS
    folder = machine(tmp_path, AXES[:2], AXES[2:], {**columns, **change(columns)}, H)
    assert words in refused(verb, folder, capsys)


@VERBS
@pytest.mark.parametrize("factor", [0.2, 2.0, 1000.0])
def test_a_supply_that_is_off_is_blamed_before_anything_is_sought(factor, verb, tmp_path, capsys):
    columns = {name: values for name, values in of_axes(4).items() if name in AXES}
    volts = {name: factor * columns[name] for name in AXES[:2]}
    folder = machine(tmp_path, AXES[:2], AXES[2:], {**columns, **volts}, H)
    assert f"voltage_d_V and voltage_q_V look about {factor:g} times too large" in refused(verb, folder, capsys)


@VERBS
@pytest.mark.parametrize("missing", ["supply_V", "angle_rad", "duty_b"])
def test_a_column_of_the_bridges_that_is_missing(missing, verb, tmp_path, capsys):
    columns = {name: values for name, values in of_bridges().items() if name != missing}
    columns |= {f"current_{name}_A": columns["speed_rad_s"] for name in "ab"}
    folder = machine(tmp_path, INPUTS, ["current_a_A", "current_b_A", "speed_rad_s"], columns, STEP)
    assert f"log.csv: column {missing} is missing" in refused(verb, folder, capsys)


def test_duties_in_percent_are_refused_by_a_diagnosis_too(tmp_path, capsys):
    columns = of_bridges()
    columns |= {"duty_a": 100.0 * columns["duty_a"]}
    columns |= {f"current_{name}_A": columns["speed_rad_s"] for name in "ab"}
    folder = machine(tmp_path, INPUTS, ["current_a_A", "current_b_A", "speed_rad_s"], columns, STEP)
    assert "it looks like percent" in refused("diagnose", folder, capsys)


def stands_still(values, rows):
    return np.where(np.isin(np.arange(len(values)), rows), values[rows[0]], values)


@pytest.mark.parametrize(("first", "count"), [(700, 120), (400, 700)])
def test_a_reading_that_stands_still_is_no_physics(first, count, tmp_path, capsys):
    table, time, columns = motor(seeded(9))
    columns["speed_rad_s"] = stands_still(columns["speed_rad_s"], np.arange(first, first + count))
    folder = written(tmp_path / "log", (table, time, columns))
    said = refused("diagnose", folder, capsys)
    assert "speed_rad_s of log.csv stands at " in said and f"({count} rows)" in said
    (told,), _ = identified(folder, capsys)
    assert told.startswith("speed_rad_s of log.csv stands at ") and "list both parts" in told


def test_a_reading_that_dies_leaves_one_part_to_list(tmp_path, capsys):
    table, time, columns = motor(seeded(9))
    columns["speed_rad_s"] = stands_still(columns["speed_rad_s"], np.arange(1700, len(time)))
    (told,), _ = identified(written(tmp_path / "log", (table, time, columns)), capsys)
    assert told.startswith("speed_rad_s of log.csv stands at ") and told.endswith("cut these rows out")


def test_a_position_that_stands_still_and_then_leaps_is_told_and_one_of_a_body_at_rest_is_not(tmp_path, capsys):
    table, time, columns = stage(seeded(4))
    assert identified(written(tmp_path / "sound", (table, time, columns)), capsys)[0] == []
    wrong = {**columns, "position_m": stands_still(columns["position_m"], np.arange(700, 900))}
    (told,), _ = identified(written(tmp_path / "log", (table, time, wrong)), capsys)
    assert told.startswith("position_m of log.csv stands at ") and "and then leaps by" in told
    assert "(200 rows)" in told and "list both parts" in told


def test_a_coarse_reading_and_a_motor_that_sticks_do_not_stand_still(tmp_path, capsys):
    table, time, columns = motor(seeded(9), friction=0.02)
    sticks = np.round(columns["speed_rad_s"] / 4.0) * 4.0
    says, _ = identified(written(tmp_path / "log", (table, time, {**columns, "speed_rad_s": sticks})), capsys)
    assert not [one for one in says if "stands at" in one], says


@pytest.mark.parametrize("wrong", [-9999.0, 65535.0])
def test_a_reading_of_the_input_that_failed_is_no_physics(wrong, tmp_path, capsys):
    table, time, columns = motor(seeded(9))
    columns["voltage_V"][700] = wrong
    said = refused("diagnose", written(tmp_path / "log", (table, time, columns)), capsys)
    assert f"voltage_V of log.csv reads {wrong:.6g} at " in said and "delete the row" in said


def test_a_plant_that_waits_for_its_input_does_not_stand_still(tmp_path, capsys):
    table, time, columns = motor(seeded(9))
    waits = {name: np.concatenate([np.full(300, values[0]), values])[: len(time)] for name, values in columns.items()}
    waits["speed_rad_s"][:300] = 50.0  # a level of which the plant as given, which begins at rest, knows nothing
    waits["voltage_V"][:300] = 6.0
    says, _ = identified(written(tmp_path / "log", (table, time, waits)), capsys)
    assert not [one for one in says if "stands at" in one], says

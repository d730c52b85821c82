"""`identify` says what is missing and the key that mends it; following what it says gives the right plant."""

from __future__ import annotations

import json
import re
import tomllib

import numpy as np
import pytest

from bench.host.identify_faults import (
    MOTOR,
    changed,
    closed_loop,
    heater,
    held,
    kiln,
    motor,
    noise,
    scene,
    stage,
    swing,
)
from firmloop.cli import main
from firmloop.identify.fitting.checks import checks


def seeded(seed: int) -> np.random.Generator:
    return np.random.default_rng([7, seed])


def logged(file, time, columns):
    """Write a recording of these columns."""
    values = np.column_stack([time, *columns.values()])
    np.savetxt(file, values, delimiter=",", header=",".join(["time_s", *columns]), comments="", fmt="%.9g")


def written(folder, made, *more: str, effects: str = ""):
    """Write a project and its recording; `more` are lines of [plant.parameters]."""
    table, time, columns = made
    folder.mkdir()
    logged(folder / "log.csv", time, columns)
    parameters = [
        f"{name} = {{ value = {given['value']!r}, free = {str(given['free']).lower()} }}"
        if isinstance(given, dict)
        else f"{name} = {given!r}"
        for name, given in table["parameters"].items()
    ]
    text = [
        'schema = 1\nname = "bench"\n[recordings]\ntrain = ["log.csv"]\n[plant]',
        f'kind = "{table["kind"]}"\ninput = "{table["input"]}"\noutputs = {json.dumps(table["outputs"])}',
        "[plant.parameters]",
        *parameters,
        *more,
        effects,
    ]
    (folder / "project.toml").write_text("\n".join(text) + "\n")
    return folder


def identified(folder, capsys) -> tuple[list[str], dict[str, float]]:
    """Return what `identify` warns of, and the fitted values."""
    assert main(["identify", str(folder / "project.toml"), "--out", str(folder / "out"), "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    fit = document["plant"]
    with (folder / "out" / "project.toml").open("rb") as file:
        assert set(tomllib.load(file)["plant"]["parameters"]) == {n for n in fit["parameters"] if "." not in n}
    return fit["warnings"], {name: entry["value"] for name, entry in fit["parameters"].items()}


WARM = {
    "heater": (lambda: changed(heater(seeded(1)), temperature_C=lambda v: v + 23.4), "temperature_C", 23.4, 0.62),
    "cooler": (lambda: changed(heater(seeded(2)), temperature_C=lambda v: v - 8.0), "temperature_C", -8.0, 0.62),
    "swing": (lambda: changed(swing(seeded(3)), level=lambda v: v + 1.5), "level", 1.5, 2.0),
    "lazy": (lambda: changed(heater(seeded(4), lag=300.0), temperature_C=lambda v: v + 9), "temperature_C", 9.0, 0.62),
    "kelvin": (lambda: changed(kiln(seeded(1)), temperature_C=lambda v: v + 293.15), "temperature_C", 293.15, 2.5),
    "freezer": (lambda: changed(kiln(seeded(6)), temperature_C=lambda v: v - 18.0), "temperature_C", -18.0, 2.5),
    "valve from its middle": (lambda: changed(swing(seeded(5)), valve_V=lambda v: v + 6.0), "level", -12.0, 2.0),
}  # fmt: skip


@pytest.mark.parametrize("name", WARM)
def test_an_output_that_rests_elsewhere_is_told_with_the_line_that_mends_it(name, tmp_path, capsys):
    make, output, level, gain = WARM[name]
    made = make()
    says, _ = identified(written(tmp_path / "plain", made), capsys)
    assert len(says) == 1 and says[0].startswith(f"{output} rests at ")
    assert "write output_at_rest = { value = " in says[0]
    line = says[0].partition("write ")[2].partition(" in [")[0]
    says, found = identified(written(tmp_path / "mended", made, line), capsys)
    assert says == []
    assert found["output_at_rest"] == pytest.approx(level, abs=0.1)
    assert found["gain"] == pytest.approx(gain, rel=0.02)


TURNED = {
    "encoder": lambda: changed(motor(seeded(1)), speed_rad_s=np.negative),
    "shunt": lambda: changed(motor(seeded(2)), current_A=np.negative),
    "position": lambda: changed(stage(seeded(3)), position_m=np.negative),
    "heater": lambda: changed(heater(seeded(4)), temperature_C=np.negative),
}


@pytest.mark.parametrize("name", TURNED)
def test_a_reading_that_runs_backwards_is_told_and_nothing_that_follows_from_it(name, tmp_path, capsys):
    says, _ = identified(written(tmp_path / name, TURNED[name]()), capsys)
    assert len(says) == 1 and "runs against" in says[0] and "turn the sign" in says[0]


@pytest.mark.parametrize("wrong", [[85.0], [-127.0], [65535.0, 65535.0], [9.9e29]])
def test_a_reading_that_failed_is_told_with_its_time_and_nothing_that_follows_from_it(wrong, tmp_path, capsys):
    rows = [801, 1303][: len(wrong)]

    def failed(values):
        return np.array([wrong[rows.index(k)] if k in rows else value for k, value in enumerate(values)])

    says, _ = identified(written(tmp_path / "log", changed(heater(seeded(1)), temperature_C=failed)), capsys)
    assert len(says) == 1 and f"reads {wrong[0]:.6g} at " in says[0] and "delete the row" in says[0], says


@pytest.mark.parametrize("row", [801, 802, 850])
def test_a_reading_that_failed_beside_steps_of_the_input_is_told(row, tmp_path, capsys):
    """Rows 801 and 802 answer a step of the voltage, as 24 others do."""

    def failed(values):
        return np.where(np.arange(len(values)) == row, -3e4, values)

    made = motor(seeded(9))
    moves = np.flatnonzero(np.diff(made[2]["voltage_V"]))
    row += int(moves[len(moves) // 2]) - 800
    says, _ = identified(written(tmp_path / "log", changed(made, speed_rad_s=failed)), capsys)
    assert len(says) == 1 and "speed_rad_s of log.csv reads -30000" in says[0], says


@pytest.mark.parametrize(("wrong", "rows"), [(-9999.0, [700]), (65535.0, [700, 720, 980]), (999.0, [700, 701, 702])])
def test_a_reading_of_the_input_that_failed_is_told_as_one_of_an_output_is(wrong, rows, tmp_path, capsys):
    def failed(values):
        return np.where(np.isin(np.arange(len(values)), rows), wrong, values)

    says, _ = identified(written(tmp_path / "log", changed(motor(seeded(9)), voltage_V=failed)), capsys)
    assert len(says) == 1 and f"voltage_V of log.csv reads {wrong:.6g} at " in says[0] and "delete the row" in says[0]


def test_readings_of_an_output_that_failed_in_a_row_are_told(tmp_path, capsys):
    def failed(values):
        return np.where(np.isin(np.arange(len(values)), [801, 802, 803]), -127.0, values)

    says, _ = identified(written(tmp_path / "log", changed(heater(seeded(1)), temperature_C=failed)), capsys)
    assert len(says) == 1 and "reads -127 at " in says[0] and "2 more such" in says[0], says


VOLTS = [(1 / 24, "about 24 V, and with its volts"), (100 / 24, "about 24 V, and with a hundredth of its volts")]


@pytest.mark.parametrize(
    ("scale", "looks"), [(1e3, "in thousandths"), *VOLTS, (255 / 24, "its volts over the count of a full duty")]
)
def test_a_voltage_in_another_unit_is_no_gear_and_its_line_gives_the_motor_back(scale, looks, tmp_path, capsys):
    made = changed(motor(seeded(6)), voltage_V=lambda v: scale * v)
    folder = written(tmp_path / "plain", made)
    (said, *_), _ = identified(folder, capsys)
    assert said.startswith("ke / kt is ") and "voltage_V looks " in said and looks in said and "gear" not in said
    text = (folder / "project.toml").read_text()
    line = said.partition("[recordings.rename] ")[2]
    (folder / "project.toml").write_text(text.replace("[plant]", f"[recordings.rename]\n{line}\n[plant]", 1))
    says, found = identified(folder, capsys)
    assert says == []
    assert found["ke_V_s_rad"] == pytest.approx(MOTOR["ke_V_s_rad"], rel=0.03)


def test_a_speed_and_a_current_in_other_units_are_told_one_after_the_other(tmp_path, capsys):
    rpm = {"speed_rad_s": lambda v: v * 60.0 / (2.0 * np.pi)}
    both = changed(motor(seeded(6)), **rpm, current_A=lambda v: 1e3 * v)
    (said, *_), _ = identified(written(tmp_path / "both", both), capsys)
    assert "the speed looks in revolutions per minute" in said and "voltage_V" not in said, said


@pytest.mark.parametrize("gear", [4.0, 20.0, 0.25, 51.0])
def test_a_gear_is_told_and_its_key_gives_the_motor_back(gear, tmp_path, capsys):
    made = motor(seeded(5), gear=gear)
    says, _ = identified(written(tmp_path / "plain", made), capsys)
    assert len(says) == 1 and says[0].startswith("ke / kt is ")
    line = says[0].partition("write ")[2].partition(" in [")[0]
    says, found = identified(written(tmp_path / "mended", made, line), capsys)
    assert says == []
    assert found["gear_ratio"] == pytest.approx(gear, rel=0.01)
    assert found["ke_V_s_rad"] == pytest.approx(MOTOR["ke_V_s_rad"], rel=0.02)
    assert found["J_kg_m2"] == pytest.approx(MOTOR["J_kg_m2"], rel=0.03)


def test_a_gear_as_large_as_a_unit_is_told_beside_it(tmp_path, capsys):
    says, _ = identified(written(tmp_path / "plain", motor(seeded(5), gear=6.25)), capsys)
    assert len(says) == 1 and "the speed looks in turns" in says[0] and "gear_ratio = { value = 6.25," in says[0]


def test_a_gear_is_told_beside_a_given_inertia(tmp_path, capsys):
    table, time, columns = motor(seeded(5), gear=51.0)
    inertia = {"value": MOTOR["J_kg_m2"], "free": False}
    freed = {**table["parameters"]["kt_N_m_A"], "free": True}
    table = {**table, "parameters": {**table["parameters"], "J_kg_m2": inertia, "kt_N_m_A": freed}}
    says, _ = identified(written(tmp_path / "plain", (table, time, columns)), capsys)
    assert len(says) == 1 and "write gear_ratio = { value = 51" in says[0], says


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"speed_rad_s": lambda v: v * 60.0 / (2.0 * np.pi)}, "the speed looks in revolutions per minute"),
        ({"speed_rad_s": np.degrees}, "the speed looks in degrees"),
        ({"current_A": lambda v: 1e3 * v}, "current_A is .* times .* in thousandths of the unit"),
    ],
)
def test_a_unit_is_told_by_name(change, says, tmp_path, capsys):
    found, _ = identified(written(tmp_path / "unit", changed(motor(seeded(6)), **change)), capsys)
    assert len(found) == 1 and "[recordings.rename]" in found[0]
    assert re.search(says, found[0])


@pytest.mark.parametrize(("factor", "looks"), [(np.degrees(1.0), ""), (1.0 / (2.0 * np.pi), ""), (1e3, "thousandths")])
def test_a_position_along_a_rail_is_in_no_unit_of_a_shaft(factor, looks, tmp_path, capsys):
    found, _ = identified(
        written(tmp_path / "unit", changed(stage(seeded(3)), position_m=lambda v: factor * v)), capsys
    )
    said = " ".join(found)
    assert "position_m is " in said and looks in said
    assert not re.search("degrees|turns|revolutions|per minute", said), said


def pushed(rows: slice, to: float, drive):
    drive = drive.copy()
    drive[rows] = to
    return drive


def turned(drive, step=0.01, torque=0.001, inertia=1e-5, drag=2e-5):
    """The position of a stage, which hardly moves faster for a short push."""
    position = held([[-drag / inertia, 0], [1, 0]], [1 / inertia, 0], [[0, 1]], torque * drive, step)[:, 0]
    given = {name: {"value": value, "free": True} for name, value in (("J_kg_m2", inertia), ("b_N_m_s_rad", drag))}
    table = {"kind": "rotary_stage", "input": "torque_N_m", "outputs": ["position_rad"], "parameters": given}
    noisy = position + noise(seeded(3), len(drive), 1e-3)
    return table, np.arange(len(drive)) * step, {"torque_N_m": torque * drive, "position_rad": noisy}


SQUARE = np.where(np.sin(0.02 * np.arange(1000)) > 0.0, 1.0, -1.0)
PUSHES = {
    "a boost that a heater answers after its dead time": lambda: heater(
        seeded(1), drive=pushed(slice(200, 203), 100.0, np.where(np.arange(300) > 50, 30.0, 0.0)), rows=300
    ),
    "a push that turns a position": lambda: turned(pushed(slice(300, 304), 10.0, SQUARE)),
    "a push of one row": lambda: turned(pushed(slice(300, 301), 15.0, SQUARE)),
}


@pytest.mark.parametrize("name", PUSHES)
def test_a_short_push_that_the_plant_answers_is_no_reading_that_failed(name, tmp_path, capsys):
    says, _ = identified(written(tmp_path / "log", PUSHES[name]()), capsys)
    assert not [each for each in says if "a reading that failed" in each]


@pytest.mark.parametrize("counts", [400, 2000, 6400, 65536])
@pytest.mark.parametrize("outputs", [["speed_rad_s", "current_A"], ["speed_rad_s"]])
def test_counts_of_an_encoder_are_told_before_any_gear_and_the_line_gives_the_motor_back(
    counts, outputs, tmp_path, capsys
):
    table, time, columns = changed(motor(seeded(6)), speed_rad_s=lambda v: v * counts / (2.0 * np.pi))
    table = {**table, "outputs": outputs}
    folder = written(tmp_path / "counts", (table, time, {name: columns[name] for name in ("voltage_V", *outputs)}))
    (said, *_), _ = identified(folder, capsys)
    assert "in counts of an encoder, about " in said and "gear" not in said.partition("counts")[0], said
    about = float(re.search(r"about ([\d.e+]+) a turn", said)[1])
    assert about == pytest.approx(counts, rel=0.05 if len(outputs) > 1 else 0.6)


def test_time_in_milliseconds_is_told(tmp_path, capsys):
    table, time, columns = motor(seeded(7))
    says, _ = identified(written(tmp_path / "ms", (table, 1e3 * time, columns)), capsys)
    assert says[0].startswith("time_s of ") and "looks like milliseconds" in says[0]


def test_a_second_lag_that_goes_to_zero_is_told(tmp_path, capsys):
    table, time, columns = heater(seeded(8))
    lags = {"gain": 0.5, "time_constant_s": 100.0, "second_time_constant_s": 3.0, "delay_s": 10.0}
    free = {name: {"value": value, "free": True} for name, value in lags.items()}
    _, found = identified(
        written(tmp_path / "run", ({**table, "kind": "process", "parameters": free}, time, columns)), capsys
    )
    assert found["gain"] == pytest.approx(0.62, rel=0.02)
    assert found["time_constant_s"] + found["second_time_constant_s"] == pytest.approx(140.0, rel=0.03)


def test_time_in_minutes_is_told_and_not_as_a_sign(tmp_path, capsys):
    made = scene("time in minutes 8124")
    says, _ = identified(written(tmp_path / "run", (made.table, made.time, made.columns)), capsys)
    assert "looks like minutes" in says[0] and not any("sign" in said for said in says), says


def test_an_offset_of_a_current_is_told_as_an_effect_that_mends_it(tmp_path, capsys):
    made = changed(motor(seeded(8)), current_A=lambda v: v + 0.4)
    says, _ = identified(written(tmp_path / "plain", made), capsys)
    assert len(says) == 1 and "current_A reads 0.4" in says[0] and 'name = "sensor_offset"' in says[0]
    effect = '[[plant.effects]]\nname = "sensor_offset"\noutput = "current_A"\noffset_A = { value = 0.4, free = true }'
    says, found = identified(written(tmp_path / "mended", made, effects=effect), capsys)
    assert says == []
    assert found["sensor_offset.current_A.offset_A"] == pytest.approx(0.4, abs=0.01)


LEFT = ("dry friction 0", "an order is missing 1", "one sine 0", "input never moves 0", "drifts 1", "warms up 0")


@pytest.mark.parametrize("name", LEFT)
def test_what_is_left_or_not_excited_is_told(name, tmp_path, capsys):
    made = scene(name)
    says, _ = identified(written(tmp_path / "run", (made.table, made.time, made.columns)), capsys)
    marks = {"structure": "is no noise", "excitation": "record", "drift": "drifts by", "rest": "more than the plant"}
    assert any(marks[check] in said for check in made.expected for said in says), says


SOUND = (
    "motor, coloured noise 0",
    "heater, slow noise 1",
    "heater, few rows 0",
    "closed loop, coloured noise 0",
    "slow plant 0",
)


@pytest.mark.parametrize("name", SOUND)
def test_sound_recordings_are_not_complained_of(name, tmp_path, capsys):
    made = scene(name)
    assert identified(written(tmp_path / "run", (made.table, made.time, made.columns)), capsys)[0] == []


def test_a_loop_that_is_closed_is_no_fault(tmp_path, capsys):
    assert identified(written(tmp_path / "run", closed_loop(seeded(9))), capsys)[0] == []


def test_every_check_is_found_and_silences_checks_there_are():
    names = [check.name for check in checks()]
    assert len(names) == len(set(names)) >= 8
    for check in checks():
        assert set(check.silences) <= set(names), check.name
        assert set(check.silenced_by) <= set(names), check.name


def test_parameters_that_one_output_only_tells_together_are_named_together(tmp_path, capsys):
    """Speed alone tells the sum of viscous friction and back EMF: no input would tell them apart."""
    made = motor(seeded(21))
    table, time, columns = made
    free = {
        name: {"value": value, "free": name in ("ke_V_s_rad", "J_kg_m2", "b_N_m_s_rad")}
        for name, value in MOTOR.items()
    }
    speed = {name: values for name, values in columns.items() if name in ("voltage_V", "speed_rad_s")}
    folder = written(tmp_path / "log", ({**table, "outputs": ["speed_rad_s"], "parameters": free}, time, speed))
    assert main(["identify", str(folder / "project.toml"), "--out", str(folder / "out")]) == 0
    said = "".join(capsys.readouterr())
    assert re.search(r"ke_V_s_rad.* and b_N_m_s_rad are only known together", said)
    assert "excite the plant more" not in said and "drive it further" not in said


def test_a_speed_that_reads_zero_at_the_resting_command_has_no_other_level(tmp_path, capsys):
    """An ESC at 1000 us holds the motor still; from there its speed begins only at 1060 us."""
    rng = seeded(22)
    time = np.arange(1500) * 0.02
    pulse = np.concatenate([np.full(60, 1000.0), np.repeat(rng.uniform(1100.0, 1600.0, 30), 48)])
    speed, share = np.zeros(len(time)), np.exp(-0.02 / 0.1)
    for k in range(len(time) - 1):
        speed[k + 1] = share * speed[k] + (1.0 - share) * max(pulse[k] - 1060.0, 0.0)
    speed[60:] += noise(rng, len(time) - 60, 0.5)
    parameters = {
        "gain": {"value": 1.0, "free": True},
        "time_constant_s": {"value": 0.2, "free": True},
        "delay_s": 0.0,
        "input_at_rest": 1000.0,
    }
    table = {"kind": "first_order", "input": "esc_us", "outputs": ["speed_rad_s"], "parameters": parameters}
    folder = written(tmp_path / "log", (table, time, {"esc_us": pulse, "speed_rad_s": speed}))
    main(["identify", str(folder / "project.toml"), "--out", str(folder / "out")])
    assert "output_at_rest" not in "".join(capsys.readouterr())


UNSEEN = {1.0: "", 0.6: "times what is left of any train recording", -1.0: "by more than its mean would"}


@pytest.mark.parametrize("gain", UNSEEN)
def test_a_test_recording_that_the_fit_does_not_carry_over_to_is_named(gain, tmp_path, capsys):
    table, time, columns = heater(seeded(23), rows=600)
    folder = written(tmp_path / "log", (table, time, columns))
    output = table["outputs"][0]
    level = columns[output] - columns[output][0]
    logged(folder / "later.csv", time, {**columns, output: columns[output][0] + gain * level})
    project = folder / "project.toml"
    project.write_text(project.read_text().replace("[plant]", 'test = ["later.csv"]\n[plant]', 1))
    assert main(["identify", str(project), "--out", str(folder / "out")]) == 0
    said = "".join(capsys.readouterr())
    for told in filter(None, UNSEEN.values()):
        assert (f"{output} of later.csv is missed by" in said and told in said) == (told == UNSEEN[gain])

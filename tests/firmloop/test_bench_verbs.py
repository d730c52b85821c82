"""`firmloop datasheet`, `excite` and `model`: what they leave and how they end."""

from __future__ import annotations

import csv
import json
import math
import shutil
import subprocess
import tomllib
from pathlib import Path

import numpy as np
import pytest
import scipy.signal

from firmloop.cli import main

SHEET = """\
schema = 1
name = "re15"
[datasheet]
nominal_voltage = "12 V"
terminal_resistance = "24.5 ohm"
terminal_inductance = "0.5 mH"
torque_constant = "13.6 mN*m/A"
mechanical_time_constant = "9 ms"
[standard_tests.no_load]
voltage_V = [4, 8, 12]
current_A = ["5 mA", "6 mA", "7 mA"]
speed_rad_s = ["2730 rpm", "5570 rpm", "8370 rpm"]
"""
EXPERIMENT = """\
[experiment]
signal = "multisine"
low = -6
high = 6
period_s = 0.001
duration_s = 1
repeats = 3
"""


def _file(folder: Path, text: str) -> Path:
    path = folder / "re15.toml"
    path.write_text(text)
    return path


def test_datasheet_makes_a_plant(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    assert main(["datasheet", str(_file(tmp_path, SHEET)), "--out", str(out)]) == 0
    said = capsys.readouterr().out
    assert "no_load test" in said and "second order: speed/voltage" in said and "J = tau_m kt^2/R" in said
    assert "a datasheet gives no 95 % intervals" in said and "J_kg_m2      6.79e-08 ± 8.4e-09 kg*m^2" in said
    tolerance = json.loads((out / "datasheet.json").read_text())["parameters"]["J_kg_m2"]["tolerance"]
    inertia = 0.009 * 0.0136**2 / 24.5
    moves = (0.05, 1.05**2 - 1.0, 1.0 - 1.0 / 1.05)  # of time constant, torque constant and resistance, each 5 % off
    assert tolerance == pytest.approx(inertia * sum(each**2 for each in moves) ** 0.5)
    plant = tomllib.loads((out / "project.toml").read_text())["plant"]
    assert plant["parameters"]["J_kg_m2"]["value"] == pytest.approx(0.009 * 0.0136**2 / 24.5)
    assert plant["effects"][0]["name"] == "coulomb_friction"
    # It is a project in its own right.
    recording = tmp_path / "step.csv"
    recording.write_text("time_s,voltage_V\n0,12\n0.01,12\n0.02,12\n")
    made = tmp_path / "step_made.csv"
    assert main(["simulate", str(out / "project.toml"), str(recording), "--out", str(made)]) == 0


@pytest.mark.parametrize(
    "printed", ["1.92 mV*min", "1.92 mV/min^-1", "1.92 mV/min⁻¹", "1.92 V/krpm", "1.92 mV/(1/min)"]
)
def test_datasheet_counts_a_speed_in_turns(printed: str, tmp_path: Path) -> None:
    text = (
        'schema = 1\nname = "motor"\n[datasheet]\nterminal_resistance = "8.4 Ω"\nterminal_inductance = "310 μH"\n'
        f'back_emf_constant = "{printed}"\nrotor_inertia = "6.4 gcm²"\ndamping = "2.1 µNms"\n'
    )
    assert main(["datasheet", str(_file(tmp_path, text)), "--out", str(tmp_path / "out")]) == 0
    found = tomllib.loads((tmp_path / "out" / "project.toml").read_text())["plant"]["parameters"]
    values = {name: entry["value"] for name, entry in found.items()}
    assert values == pytest.approx(
        {
            "R_ohm": 8.4,
            "L_H": 310e-6,
            "ke_V_s_rad": 1.92e-3 * 60 / (2 * math.pi),
            "kt_N_m_A": 1.92e-3 * 60 / (2 * math.pi),
            "J_kg_m2": 6.4e-7,
            "b_N_m_s_rad": 2.1e-6,
        }
    )


@pytest.mark.parametrize(
    ("figure", "slip"),
    [
        ('back_emf_constant = "1.424 mV*s/rad"', "60/(2 pi), as between rpm and rad/s"),  # printed in mV/rpm
        ('speed_constant = "702 rad/s/V"', "60/(2 pi)"),
        ('torque_constant = "13.6 N*m/A"\nback_emf_constant = "13.6 mV*s/rad"', "1000"),
        ('back_emf_constant = "0.0192 V*s/rad"', "sqrt(2), as between peak and rms"),
    ],
)
def test_datasheet_says_which_unit_would_explain_a_contradiction(
    figure: str, slip: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    kept = "" if "torque_constant" in figure else 'torque_constant = "13.6 mN*m/A"\n'
    text = f'schema = 1\nname = "motor"\n[datasheet]\n{kept}{figure}\n'
    assert main(["datasheet", str(_file(tmp_path, text)), "--out", str(tmp_path / "out")]) == 1
    said = capsys.readouterr().out
    assert f"a factor of {slip}" in said and "check the units" in said


SOUND = {
    "nominal_voltage": "24 V",
    "terminal_resistance": "2.5 ohm",
    "torque_constant": "30 mNm/A",
    "no_load_current": "50 mA",
    "rotor_inertia": "12 gcm²",
    "stall_current": "9.6 A",
    "stall_torque": "288 mNm",
    "speed_torque_gradient": "26.5 rpm/mNm",
    "mechanical_time_constant": "3.33 ms",
}


@pytest.mark.parametrize(
    ("figure", "printed", "factor", "pair"),
    [
        ("stall_torque", "288 Ncm", "10", "N*cm (cN*m) and mN*m"),
        ("stall_torque", "2.88 mNm", "100", "cm and m"),
        ("stall_torque", "40.8 Nm", "141.6", "oz-in and N*m"),
        ("stall_torque", "40.8 mNm", "7.062", "oz-in and mN*m"),
        ("stall_torque", "2.55 mNm", "113", "lb-in and mN*m"),
        ("stall_torque", "2.94 kgf*cm", "", ""),
        ("stall_torque", "288 kgf*cm", "98.07", "kgf*cm and mN*m"),
        ("stall_torque", "2.94 mNm", "98.07", "kgf*cm and mN*m"),
        ("speed_torque_gradient", "26.5 rad/s/Nm", "1000 * 2 pi/60", "V/krpm and V/(rad/s), or rpm/(mN*m)"),
        ("speed_torque_gradient", "26.5 rad/s/mNm", "60/(2 pi)", "rpm and rad/s"),
        ("rotor_inertia", "0.0656 gcm²", "182.9", "oz-in^2 and g*cm^2"),
        ("rotor_inertia", "12 kg*m^2", "10^7", "g*cm^2 and kg*m^2"),
        ("rotor_inertia", "48 gcm²", "4", "GD^2 and J"),
        ("rotor_inertia", "1.7e-4 oz-in^2", "386.1", "oz-in-s^2 and oz-in^2"),
    ],
)
def test_datasheet_names_the_two_units_that_makers_print_side_by_side(
    figure: str, printed: str, factor: str, pair: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    lines = [f'{key} = "{value}"' for key, value in {**SOUND, figure: printed}.items()]
    text = "\n".join(['schema = 1\nname = "motor"', "[datasheet]", *lines, ""])
    assert main(["datasheet", str(_file(tmp_path, text)), "--out", str(tmp_path / "out")]) == (1 if pair else 0)
    said = capsys.readouterr().out
    assert (f"a factor of {factor}, as between {pair}" in said) if pair else ("CONTRADICTION" not in said)


def test_datasheet_names_no_unit_where_none_explains_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = SHEET.replace('"13.6 mN*m/A"', '"13.6 mN*m/A"\nspeed_constant = "900 rpm/V"')
    assert main(["datasheet", str(_file(tmp_path, text)), "--out", str(tmp_path / "out")]) == 1
    said = capsys.readouterr().out
    assert "CONTRADICTION" in said and "check the units" not in said


def test_datasheet_says_what_leads_below_zero_without_a_share_of_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    sheet = 'nominal_voltage = "24 V"\nno_load_speed = "8000 rpm"\nno_load_current = "50 A"\n'
    sheet += 'terminal_resistance = "6.6 ohm"\ntorque_constant = "28 mNm/A"\n'
    path, out = _file(tmp_path, f'schema = 1\nname = "motor"\n[datasheet]\n{sheet}'), tmp_path / "out"
    assert main(["datasheet", str(path), "--out", str(out)]) == 1
    said = capsys.readouterr().out
    assert "none can be 0 or less" in said and "inf" not in said
    assert json.loads((out / "datasheet.json").read_text())["contradictions"][0]["share"] is None


@pytest.mark.parametrize("tolerance", ["-1e30", "-0.1", "1.0", "1e30"])
def test_a_tolerance_that_is_no_share_is_refused(
    tolerance: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    head, *rest = SHEET.partition("[datasheet]\n")
    path = _file(tmp_path, "".join([head, rest[0], f"tolerance = {tolerance}\n", *rest[1:]]))
    assert main(["datasheet", str(path), "--out", str(tmp_path / "out")]) == 2
    assert f"tolerance = {float(tolerance)!r}: must be a share from 0 to below 1" in capsys.readouterr().err


@pytest.mark.parametrize("beside", ["\u00b110 %", "+/- 10 %", "@ 25 degC", "at 25 degC", "max."])
def test_datasheet_tells_a_condition_beside_a_unit_from_a_unit(
    beside: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = _file(tmp_path, f'schema = 1\nname = "motor"\n[datasheet]\nterminal_resistance = "8.4 Ohm {beside}"\n')
    assert main(["datasheet", str(path), "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    assert "write the number and its unit alone" in said and "datasheet.tolerance" in said


def test_datasheet_names_two_figures_that_contradict_each_other(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = SHEET.replace("[standard", 'speed_constant = "900 rpm/V"\n[standard')
    assert main(["datasheet", str(_file(tmp_path, text)), "--out", str(tmp_path / "out")]) == 1
    said = capsys.readouterr().out
    assert "CONTRADICTION: torque_constant is 0.0136 N*m/A, but speed_constant leads to 0.01061 N*m/A" in said
    document = json.loads((tmp_path / "out" / "datasheet.json").read_text())
    assert document["contradictions"][0]["share"] == pytest.approx(0.2817, abs=1e-3)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('"24.5 ohm"', '"24.5 furlong"', "furlong"),
        ('"24.5 ohm"', '"-24.5 ohm"', "must be above 0"),
        ("torque_constant", "torque_konstant", "no such figure"),
        ("voltage_V = [4, 8, 12]", "voltage_V = [4, 8]", "different numbers of readings"),
        ("voltage_V = [4, 8, 12]", "voltage_V = [0.1, 0.1, 0.1]", "more than the 0.1 V applied"),
        (SHEET[SHEET.index("[datasheet]") :], "", "[datasheet] with figures"),
    ],
)
def test_datasheet_refuses(tmp_path: Path, capsys: pytest.CaptureFixture[str], old: str, new: str, words: str) -> None:
    assert main(["datasheet", str(_file(tmp_path, SHEET.replace(old, new))), "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    assert words in said and len(said.splitlines()) == 1


def test_a_sheet_that_says_too_little_says_what_is_missing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = SHEET.replace('mechanical_time_constant = "9 ms"\n', "")
    assert main(["datasheet", str(_file(tmp_path, text)), "--out", str(tmp_path / "out")]) == 0
    assert "J_kg_m2: give rotor_inertia or mechanical_time_constant and" in capsys.readouterr().out
    assert not (tmp_path / "out" / "project.toml").exists()


def test_excite_leaves_a_signal_and_its_c_table(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    path = _file(tmp_path, 'schema = 1\nname = "re15"\n' + EXPERIMENT)
    assert main(["excite", str(path), "--out", str(out)]) == 0
    assert "multisine of voltage_V, 3300 samples" in capsys.readouterr().out
    with (out / "excitation.csv").open() as stream:
        values = np.array([float(row["voltage_V"]) for row in csv.DictReader(stream)])
    compiler = shutil.which("gcc")
    if compiler is None:
        pytest.skip("gcc is not installed")
    (out / "main.c").write_text(
        '#include "re15_excitation.h"\n#include <stdio.h>\nint main(void) {\n'
        'for (unsigned long k = 0; k < RE15_EXCITATION_SAMPLES; ++k) printf("%.9g\\n", (double)re15_excitation[k]);\n'
        "return RE15_EXCITATION_PERIOD_US == 1000UL ? 0 : 1; }\n"
    )
    flags = ["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Wdouble-promotion", "-Werror"]
    subprocess.run([compiler, *flags, "main.c", "re15_excitation.c", "-o", "play"], cwd=out, check=True)
    played = subprocess.run([out / "play"], capture_output=True, text=True, check=True).stdout.split()
    assert np.array_equal(np.array(played, dtype=np.float32), values.astype(np.float32))


def test_excite_refuses(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = _file(tmp_path, 'schema = 1\nname = "re15"\n' + EXPERIMENT.replace("period_s = 0.001", "period_s = 0"))
    assert main(["excite", str(path), "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    assert "re15.toml:7: experiment.period_s is 0" in said and len(said.splitlines()) == 1


MODEL = """\
schema = 1
name = "cart"
[recordings]
train = ["one.csv"]
test = ["two.csv"]
[plant]
kind = "second_order"
input = "voltage_V"
outputs = ["speed_rad_s"]
[model]
structure = "STRUCTURE"
order = 2
delay_samples = 2
"""


@pytest.mark.parametrize("structure", ["oe", "n4sid"])
def test_model_leaves_equations_that_predict(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], structure: str
) -> None:
    (above,), below, _ = scipy.signal.cont2discrete(([72.0], [1, 6, 36.0]), 0.02)
    for name, seed in (("one.csv", 1), ("two.csv", 2)):
        random = np.random.default_rng(seed)
        drive = np.repeat(random.choice([-3.0, 3.0], 80), 10)
        output = scipy.signal.lfilter([0.0, 0.0, *above], below, drive) + random.normal(0, 0.05, 800)
        rows = [f"{k * 0.02:.2f},{u},{y:.6g}" for k, (u, y) in enumerate(zip(drive, output, strict=True))]
        (tmp_path / name).write_text("\n".join(["time_s,voltage_V,speed_rad_s", *rows]) + "\n")
    path = tmp_path / "cart.toml"
    path.write_text(MODEL.replace("STRUCTURE", structure))
    assert main(["model", str(path), "--out", str(tmp_path / "out")]) == 0
    document = json.loads((tmp_path / "out" / "model.json").read_text())
    assert document["test"][0]["fit_percent"] > 95 and document["gain"] == pytest.approx(2.0, rel=0.02)
    assert document["delay_s"] == pytest.approx(0.04)
    said = capsys.readouterr().out
    if structure == "n4sid":
        assert document["ci95_half"] is None and "no intervals" in said
    else:
        half, poles = document["ci95_half"]["gain"], np.array(document["poles_rad_s"])
        assert abs(document["gain"] - 2.0) < 2 * half < 0.05
        truth = [[-3.0, -math.sqrt(27.0)], [-3.0, math.sqrt(27.0)]]
        assert np.all(np.abs(poles - truth) < 2 * np.array(document["ci95_half"]["poles_rad_s"]))
        assert said.count(" ± ") == 5
    predicted = tmp_path / "predicted.csv"
    made = tmp_path / "out" / "project.toml"
    assert main(["simulate", str(made), str(tmp_path / "two.csv"), "--out", str(predicted)]) == 0
    told, truth = (np.genfromtxt(file, delimiter=",", names=True) for file in (predicted, tmp_path / "two.csv"))
    assert np.std(told["speed_rad_s"] - truth["speed_rad_s"]) < 0.2
    path.write_text(MODEL.replace("STRUCTURE", structure).replace("order = 2", "order = 40"))
    assert main(["model", str(path), "--out", str(tmp_path / "out")]) == 2
    capsys.readouterr()
    path.write_text(MODEL.replace("STRUCTURE", structure).replace("order = 2", "order = 12"))
    short = (tmp_path / "one.csv").read_text().splitlines()[:150]
    (tmp_path / "one.csv").write_text("\n".join(short) + "\n")
    assert main(["model", str(path), "--out", str(tmp_path / "out")]) == 2
    assert "too few for a model of order 12" in capsys.readouterr().err

"""Outputs that a log has shifted before their input are told, with the rows, and what is said mends them."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from scipy import signal

from bench.host.identify_faults import MOTOR, heater, motor, swing
from firmloop.cli import main
from firmloop.identify.error import IdentifyError
from firmloop.identify.fitting import fit
from firmloop.identify.fitting.checks import early as early_check
from firmloop.identify.fitting.covariance import untold
from firmloop.identify.fitting.evidence import Evidence
from firmloop.identify.plants.kinds import make_plant
from firmloop.identify.recordings.conditioning import NONE
from firmloop.identify.recordings.recording import make_recording
from firmloop.stages import diagnosing
from tests.firmloop.columns.test_identify_says import identified, seeded, written


def early(made, rows: int, *names: str):
    """Let the outputs come so many rows before the plant has them."""
    table, time, columns = made
    last = len(time) - rows
    return table, time[:last], {n: v[rows:] if n in names else v[:last] for n, v in columns.items()}


def valve(random: np.random.Generator, late: int):
    """Return the log of a valve without memory, whose rows hold the flow at the input of `late` rows ago."""
    time = 0.1 * np.arange(300)
    drive = np.repeat(random.uniform(0.0, 10.0, 30), 10)
    moved = np.r_[drive[:late], drive[: len(drive) - late]]
    flow = 12.0 - 3.2 * moved + 0.05 * random.normal(size=len(time))
    start = {"gain": {"value": -3.0, "free": True}, "offset": {"value": 10.0, "free": True}}
    table = {"kind": "static", "input": "valve_V", "outputs": ["flow"], "parameters": start}
    return table, time, {"valve_V": drive, "flow": flow}


CASES = {
    "one row": (lambda: motor(seeded(13), rows=1000), 1, ("speed_rad_s", "current_A")),
    "speed and current": (lambda: motor(seeded(11), rows=600), 3, ("speed_rad_s", "current_A")),
    "a second-order lag": (lambda: swing(seeded(14), rows=800), 12, ("level",)),
    "one row of a lag, most of which a fit takes for quickness": (lambda: swing(seeded(14)), 1, ("level",)),
}
QUICK = ("one row", "one row of a lag, most of which a fit takes for quickness")


@pytest.mark.parametrize("name", [*QUICK, *(pytest.param(n, marks=pytest.mark.slow) for n in CASES if n not in QUICK)])
def test_outputs_that_come_early_are_told_with_their_rows(name, tmp_path, capsys):
    make, rows, names = CASES[name]
    says, _ = identified(written(tmp_path / "log", early(make(), rows, *names)), capsys)
    told = [f"{n} of log.csv moves {rows} row" for n in names]
    assert len(says) == 1 and all(each in says[0] for each in told), says
    assert says[0].count(" moves ") == len(names)


def test_the_key_that_is_said_aligns_a_speed_that_comes_early(tmp_path, capsys):
    folder = written(tmp_path / "log", early(motor(seeded(12), rows=1000), 5, "speed_rad_s"))
    says, _ = identified(folder, capsys)
    keys = says[0].partition("do so with ")[2].partition(" in [recordings")[0].replace(" and ", "\n")
    project = folder / "project.toml"
    project.write_text(project.read_text().replace("[plant]", f"[recordings.conditioning]\n{keys}\n[plant]", 1))
    says, found = identified(folder, capsys)
    assert says == []
    assert found["ke_V_s_rad"] == pytest.approx(MOTOR["ke_V_s_rad"], rel=0.01)
    assert found["J_kg_m2"] == pytest.approx(MOTOR["J_kg_m2"], rel=0.03)


@pytest.mark.slow
def test_a_diagnosis_blames_no_physics_for_an_output_that_comes_early(tmp_path, capsys):
    made = early(heater(seeded(15), rows=100, step=16.0), 12, "temperature_C")
    folder = written(tmp_path / "log", made)
    assert main(["diagnose", str(folder / "project.toml"), "--out", str(folder / "out")]) == 2
    assert "temperature_C of log.csv moves" in capsys.readouterr().err


def test_a_diagnosis_stands_where_identify_cannot_fit_what_would_tell_a_lag(monkeypatch):
    def refusing(*_: object, **__: object) -> None:
        raise IdentifyError("parameters far off")

    monkeypatch.setattr(fit, "estimate", refusing)
    finding = SimpleNamespace(train=SimpleNamespace(after=30.0, refit=40.0))
    diagnosing._check_early(
        SimpleNamespace(states=("w",)), (), SimpleNamespace(finding=finding, search=SimpleNamespace(refit=None))
    )


def test_a_shifted_column_is_held_against_an_explanation_whose_start_is_fitted_too(monkeypatch):
    """Begun at the first reading alone, the drift of a position hid that a clock explains it."""
    asked = {}
    monkeypatch.setattr(diagnosing, "tried", lambda *_, **__: SimpleNamespace())
    monkeypatch.setattr(diagnosing, "early_outputs", lambda _, left: asked.update(left) or "")
    finding = SimpleNamespace(train=SimpleNamespace(after=30.0, refit=40.0))
    left = [SimpleNamespace(fitted=SimpleNamespace(residuals=(np.full((9, 1), size),))) for size in (0.02, 0.003)]
    plant = SimpleNamespace(outputs=(SimpleNamespace(name="level"),), states=("level",))
    search = SimpleNamespace(refit=None, nominal=left[0])
    diagnosing._check_early(plant, (), SimpleNamespace(finding=finding, search=search, shown=left[1]))
    assert asked == {"level": pytest.approx(0.003)}


def test_outputs_of_which_no_less_is_left_once_they_are_shifted_are_not_shifted_on(monkeypatch):
    """What a plant leaves out can look like a lead; each further shift would be one more fit in vain."""
    table, time, columns = early(swing(seeded(14), rows=400), 12, "level")
    kind, drive, outputs, values = (table[key] for key in ("kind", "input", "outputs", "parameters"))
    plant = make_plant(kind, drive, outputs, values)
    recording = make_recording(time, columns, "log.csv", "")
    fitted, asked = fit.estimate(plant, [recording], (), NONE, near=True), []
    monkeypatch.setattr(fit, "estimate", lambda *of, **how: asked.append(how) or fitted)
    evidence = Evidence(plant, (recording,), NONE, fitted)
    assert early_check.early_outputs(evidence, fitted.noise) == "" and asked == [{"near": True, "doubt": untold}]


def test_a_delay_that_is_given_too_long_is_no_output_that_comes_early(tmp_path, capsys):
    table, time, columns = heater(seeded(16))
    longer = {**table["parameters"], "delay_s": {"value": 60.0, "free": True}}
    says, found = identified(written(tmp_path / "log", ({**table, "parameters": longer}, time, columns)), capsys)
    assert says == [] and found["delay_s"] == pytest.approx(14.0, abs=2.0)


def test_a_plant_without_memory_that_is_read_after_its_input_has_acted_is_told_and_mended(tmp_path, capsys):
    folder = written(tmp_path / "log", valve(seeded(17), 0))
    says, _ = identified(folder, capsys)
    assert len(says) == 1 and "flow of log.csv moves 1 row (0.1 s) before valve_V does" in says[0]
    assert "a row is read before its input acts" in says[0]
    assert main(["diagnose", str(folder / "project.toml"), "--out", str(folder / "out")]) == 2
    assert "flow of log.csv moves 1 row" in capsys.readouterr().err
    keys = says[0].partition("do so with ")[2].partition(" in [recordings")[0].replace(" and ", "\n")
    project = folder / "project.toml"
    project.write_text(project.read_text().replace("[plant]", f"[recordings.conditioning]\n{keys}\n[plant]", 1))
    says, found = identified(folder, capsys)
    assert says == [] and found["gain"] == pytest.approx(-3.2, abs=0.01)
    assert found["offset"] == pytest.approx(12.0, abs=0.05)


def test_a_plant_without_memory_that_is_read_before_its_input_acts_is_not_early(tmp_path, capsys):
    says, found = identified(written(tmp_path / "log", valve(seeded(18), 1)), capsys)
    assert says == [] and found["gain"] == pytest.approx(-3.2, abs=0.01)


def test_an_output_that_is_read_through_a_filter_is_told_and_the_others_are_not_shifted(tmp_path, capsys):
    """The speed was told to be moved by 37 rows, for the fit had taken the filter of the current for the inductance."""
    table, time, columns = motor(seeded(2), rows=1500)
    share = np.exp(-1.0 / 50.0)
    current = signal.lfilter([0.0, 1.0 - share], [1.0, -share], columns["current_A"]) + seeded(2).normal(0, 0.02, 1500)
    folder = written(tmp_path / "log", (table, time, {**columns, "current_A": current}))
    says, _ = identified(folder, capsys)
    assert (
        len(says) == 1 and "current_A of log.csv is read late, for the sensor or its filter lags behind" in says[0]
    ), says
    key = says[0].partition(" and time_constant_s = ")[2]
    effect = f'[[plant.effects]]\nname = "sensor_lag"\noutput = "current_A"\ntime_constant_s = {key}\n'
    project = folder / "project.toml"
    project.write_text(f"{project.read_text()}\n{effect}")
    says, found = identified(folder, capsys)
    assert not any("moves" in each for each in says)
    assert found["ke_V_s_rad"] == pytest.approx(MOTOR["ke_V_s_rad"], rel=0.01)
    assert found["L_H"] == pytest.approx(MOTOR["L_H"], rel=0.1)

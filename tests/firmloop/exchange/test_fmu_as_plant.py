"""An FMU stands in for a plant by any names and units, with [plant] and without; what cannot be is a sentence."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import firmloop
from firmloop.cli import main
from firmloop.identify.recordings.recording import Recording, read_recording
from tests.firmloop.conftest import PROJECT, recording
from tests.firmloop.exchange.test_fmu_in_the_loop import CONTROLLER, CORE, changed
from tests.firmloop.exchange.test_plant_fmu import MOTOR

pytest.importorskip("fmpy", reason="FMPy is not installed (pip install fmpy)")

OUTPUTS = ("speed_rad_s", "current_A", "position_rad")
NAMED = ["--wire", "speed_rad_s=motor.w"]
BARE = 'schema = 1\nname = "motor"\n'


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """A motor and its controller, the same without the motor, and a recording."""
    (tmp_path / "p.toml").write_text(MOTOR + CONTROLLER)
    (tmp_path / "bare.toml").write_text(BARE + CONTROLLER)
    written(tmp_path / "log.csv", np.arange(400) * 1e-3)
    return tmp_path / "p.toml"


@pytest.fixture
def fmu(project: Path, tmp_path: Path) -> Path:
    out = tmp_path / "motor.fmu"
    assert main(["export", str(project), "--fmu", "--of", "plant", "--out", str(out)]) == 0
    return out


def written(file: Path, time: np.ndarray) -> None:
    drive = np.repeat(np.random.default_rng(3).uniform(-9, 9, len(time) // 50 + 1), 50)[: len(time)]
    rows = [f"{t!r},{u!r},0,0,0" for t, u in zip(time.tolist(), drive.tolist(), strict=True)]
    file.write_text("\n".join([f"time_s,voltage_V,{','.join(OUTPUTS)}", *rows, ""]))


def simulated(project: Path, *more: str) -> Recording:
    out = project.parent / "out.csv"
    out.unlink(missing_ok=True)
    assert main(["simulate", str(project), str(project.parent / "log.csv"), "--out", str(out), *more]) == 0
    return read_recording(out, {})


def refused(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    assert main([*words, "--out", str(Path(words[1]).parent / "no.csv")]) == 2
    return capsys.readouterr().err


@pytest.mark.parametrize("file", ["p.toml", "bare.toml"])
def test_an_exported_plant_predicts_what_its_equations_do(file: str, project: Path, fmu: Path) -> None:
    right, found = simulated(project), simulated(project.with_name(file), "--fmu", str(fmu))
    for name in OUTPUTS:
        np.testing.assert_allclose(found.columns[name], right.columns[name], rtol=1e-9, atol=1e-12)
    assert np.ptp(found.columns["speed_rad_s"]) > 50.0


def test_a_variable_of_another_name_and_unit_is_converted(project: Path, fmu: Path) -> None:
    other = changed(fmu, 'name="speed_rad_s"', 'name="motor.w"')
    other = changed(other.rename(fmu.with_name("named.fmu")), '"rad/s"', '"rpm"')
    right = simulated(project, "--fmu", str(fmu)).columns["speed_rad_s"]
    found = simulated(project, "--fmu", str(other), *NAMED).columns["speed_rad_s"]
    np.testing.assert_allclose(found, right * 2.0 * np.pi / 60.0, rtol=1e-12)


def test_rows_that_are_whole_steps_apart_need_not_be_even(project: Path, fmu: Path) -> None:
    steps = np.cumsum(np.random.default_rng(1).integers(1, 4, 300))
    written(project.with_name("log.csv"), np.round(steps * 1e-3, 6))
    right, found = simulated(project), simulated(project, "--fmu", str(fmu))
    np.testing.assert_allclose(found.columns["speed_rad_s"], right.columns["speed_rad_s"], rtol=1e-6, atol=1e-9)


@pytest.mark.qemu
def test_a_controller_without_a_plant_meets_the_fmu_as_it_meets_the_equations(project: Path, fmu: Path) -> None:
    with_equations = firmloop.verify(firmloop.load(project), targets=[CORE], steps=2000)
    bare, wires = firmloop.load(project.with_name("bare.toml")), {"measurement": "speed_rad_s"}
    with_fmu = firmloop.verify(bare, targets=[CORE], steps=2000, fmu=fmu, wires=wires)
    right, found = (run.verdicts[CORE].closed_loop for run in (with_equations, with_fmu))
    assert right is not None and found is not None and found.against == "motor.fmu"
    assert found.measurement == right.measurement and found.command == right.command
    assert max(found.measurement) > 30.0


@pytest.mark.qemu
def test_run_closes_the_loop_with_the_fmu(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for seed, name in enumerate(("train.csv", "test.csv"), 1):
        (tmp_path / name).write_text(recording(seed))
    project, out = tmp_path / "p.toml", tmp_path / "tank.fmu"
    project.write_text(PROJECT)
    assert main(["export", str(project), "--fmu", "--of", "plant", "--out", str(out)]) == 0
    asked = ["run", str(project), "--out", str(tmp_path / "out"), "--steps", "1000", "--target", CORE]
    assert main([*asked, "--fmu", str(out)]) == 0
    assert "1,000 steps against tank.fmu, the same bits as on the host" in capsys.readouterr().out


WRONG = {
    "a wire without an FMU": (["--wire", "speed_rad_s=w"], "an FMU calls it, and none is named: add --fmu FILE"),
    "a wire of no signal": (["--fmu", "motor.fmu", "--wire", "speed=w"], "speed is no signal here; known: voltage_V, "),
    "a variable that is not there": (["--fmu", "motor.fmu", *NAMED], "has no output 'motor.w'; it has speed_rad_s, "),
    "a variable in a unit of another kind": (
        ["--fmu", "motor.fmu", "--wire", "speed_rad_s=current_A"],
        "output 'current_A' is in A, and speed_rad_s in rad/s",
    ),
    "a start of ours": (["--fmu", "motor.fmu", "--fit-initial"], "begins where its maker has it begin"),
    "no FMU": (["--fmu", "log.csv"], "is no FMU that can be read"),
}


@pytest.mark.parametrize("case", WRONG)
def test_an_fmu_that_cannot_predict_is_refused_with_a_sentence(
    case: str, project: Path, fmu: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    words, says = WRONG[case]
    monkeypatch.chdir(fmu.parent)
    assert says in refused(capsys, "simulate", str(project), str(project.with_name("log.csv")), *words)


def test_an_fmu_without_a_column_for_an_input_is_refused(
    project: Path, fmu: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bare, log = project.with_name("bare.toml"), project.with_name("log.csv")
    log.write_text(log.read_text().replace("voltage_V", "drive_V"))
    asked = ["simulate", str(bare), str(log), "--fmu", str(fmu)]
    assert "none of its inputs (voltage_V) is a column of log.csv" in refused(capsys, *asked)
    assert main([*asked, "--wire", "drive_V=voltage_V", "--out", str(log.with_name("out.csv"))]) == 0


def test_a_project_names_no_fmu(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Its file would run with the rights of whoever opens a stranger's project."""
    project.write_text(project.read_text().replace("[plant]", '[plant]\nfmu = "motor.fmu"', 1))
    assert "'fmu'" in refused(capsys, "simulate", str(project), str(project.with_name("log.csv")))

"""Every verb that needs no target: what it leaves, what it says, how it ends."""

from __future__ import annotations

import csv
import json
import os
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest

from firmloop.cli import main
from firmloop.stages.board.machine import survey

ROOT = Path(__file__).parents[2]
SCHEMAS = ROOT / "tests" / "schema"


def _documents(capsys: pytest.CaptureFixture[str]) -> dict[str, Any]:
    said = capsys.readouterr()
    assert said.err == ""
    document = json.loads(said.out)
    assert isinstance(document, dict) and document["schema"] == 1
    return document


def _columns(path: Path) -> dict[str, np.ndarray]:
    with path.open() as stream:
        rows = list(csv.DictReader(stream))
    return {name: np.array([float(row[name]) for row in rows]) for name in rows[0]}


def test_identify_leaves_a_project_that_works(
    project: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["identify", str(project), "--out", str(tmp_path / "out")]) == 0
    said = capsys.readouterr()
    assert "time_constant_s" in said.out and "±" in said.out and "train train.csv" in said.out
    fitted = tmp_path / "out" / "project.toml"
    assert [path.name for path in fitted.parent.iterdir()] == ["project.toml"]
    parameters = tomllib.loads(fitted.read_text())["plant"]["parameters"]
    for name, true in (("gain", 3.0), ("time_constant_s", 2.0)):
        entry = parameters[name]
        assert entry["ci95"][0] < entry["value"] < entry["ci95"][1]
        assert abs(entry["value"] - true) < 0.02 * true
    assert "ci95" not in parameters["delay_s"]
    # It is a project in its own right: fitted again from there, it says the same.
    assert main(["identify", str(fitted), "--out", str(tmp_path / "again")]) == 0
    again = tomllib.loads((tmp_path / "again" / "project.toml").read_text())["plant"]["parameters"]
    assert again["gain"]["value"] == pytest.approx(parameters["gain"]["value"], rel=1e-6)


def test_identify_for_machines(project: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["identify", str(project), "--out", str(tmp_path / "out"), "--json"]) == 0
    plant = _documents(capsys)["plant"]
    assert isinstance(plant, dict)
    assert plant["parameters"]["gain"]["ci95"][0] < 3.0 < plant["parameters"]["gain"]["ci95"][1]
    assert [entry["recording"] for entry in plant["test"]] == ["test.csv"]
    assert plant["test"][0]["outputs"]["temperature_C"]["fit_percent"] > 98


def test_simulate_keeps_columns_and_rows(project: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    main(["identify", str(project), "--out", str(tmp_path / "out")])
    recording, out = project.parent / "test.csv", tmp_path / "predicted.csv"
    recording.write_text(
        recording.read_text()
        .replace("temperature_C", "temperature_C,note_V", 1)
        .replace("\n", ",7\n")
        .replace(",7\n", "\n", 1)
    )
    assert main(["simulate", str(tmp_path / "out" / "project.toml"), str(recording), "--out", str(out)]) == 0
    recorded, predicted = _columns(recording), _columns(out)
    assert list(predicted) == list(recorded)
    for name in ("time_s", "voltage_V", "note_V"):
        np.testing.assert_array_equal(predicted[name], recorded[name])
    error = predicted["temperature_C"] - recorded["temperature_C"]
    assert 0 < np.sqrt(np.mean(error**2)) < 0.05
    assert predicted["temperature_C"][0] == 0


def test_simulate_without_the_outputs_column(project: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    recording = tmp_path / "plan.csv"
    recording.write_text("time_s,voltage_V\n0,1\n0.05,1\n0.1,1\n")
    assert main(["simulate", str(project), str(recording), "--out", str(tmp_path / "y.csv")]) == 0
    assert list(_columns(tmp_path / "y.csv")) == ["time_s", "voltage_V", "temperature_C"]


def test_simulate_speaks_the_recordings_names(project: Path, tmp_path: Path) -> None:
    project.write_text(
        project.read_text().replace(
            "[plant]", '[recordings.rename]\nu = "voltage_V"\ny = "temperature_C"\n\n[plant]', 1
        )
    )
    recording = tmp_path / "foreign.csv"
    recording.write_text((project.parent / "test.csv").read_text().replace("voltage_V,temperature_C", "u,y"))
    assert main(["simulate", str(project), str(recording), "--out", str(tmp_path / "y.csv")]) == 0
    assert list(_columns(tmp_path / "y.csv")) == ["time_s", "u", "y"]


def test_fit_initial_starts_where_the_recording_does(project: Path, tmp_path: Path) -> None:
    main(["identify", str(project), "--out", str(tmp_path / "out")])
    lines = (project.parent / "test.csv").read_text().splitlines()
    recording = tmp_path / "late.csv"
    recording.write_text("\n".join([lines[0], *lines[30:]]))
    errors = []
    for options in ([], ["--fit-initial"]):
        arguments = [str(tmp_path / "out" / "project.toml"), str(recording), "--out", str(tmp_path / "y.csv")]
        assert main(["simulate", *arguments, *options]) == 0
        predicted = _columns(tmp_path / "y.csv")["temperature_C"]
        errors.append(abs(predicted[0] - _columns(recording)["temperature_C"][0]))
    assert errors[1] < 0.06 < 0.5 < errors[0]


def test_simulate_does_not_overwrite_the_recording(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    recording = project.parent / "test.csv"
    before = recording.read_text()
    assert main(["simulate", str(project), str(recording), "--out", str(recording)]) == 2
    assert "the recording itself" in capsys.readouterr().err
    assert recording.read_text() == before


def test_design_leaves_gains_that_make_the_same_controller(
    project: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    project.write_text(project.read_text().replace("kp = 0.8\nki = 0.5", 'tune = "simc"\nform = "tustin"'))
    assert main(["design", str(project), "--out", str(tmp_path / "out")]) == 0
    assert "phase margin" in capsys.readouterr().out
    document = json.loads((tmp_path / "out" / "design.json").read_text())
    assert document["tuned_by"] == "simc" and document["margins"]["stable"] is True
    table = tomllib.loads((tmp_path / "out" / "project.toml").read_text())["controller"]
    assert "tune" not in table and table["form"] == "tustin" and table["kp"] == document["gains"]["kp"]
    ids = []
    for path in (project, tmp_path / "out" / "project.toml"):
        assert main(["generate", str(path), "--out", str(tmp_path / "c")]) == 0
        ids.append(json.loads((tmp_path / "c" / "manifest.json").read_text())["program_id"])
    assert ids[0] == ids[1]


def test_design_without_a_plant(project: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = project.read_text()
    project.write_text(text[: text.index("[recordings]")] + text[text.index("[controller]") :])
    assert main(["design", str(project), "--out", str(tmp_path / "out"), "--json"]) == 0
    controller = _documents(capsys)["controller"]
    assert isinstance(controller, dict) and controller["gains"]["kp"] == 0.8 and controller["margins"] is None


def test_generate(project: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for recording in project.parent.glob("*.csv"):
        recording.unlink()  # generate needs none
    assert main(["generate", str(project), "--out", str(tmp_path / "out"), "--json"]) == 0
    document = _documents(capsys)
    manifest = json.loads((tmp_path / "out" / "manifest.json").read_text())
    jsonschema.validate(manifest, json.loads((SCHEMAS / "manifest.schema.json").read_text()))
    assert document["code"]["manifest"] == manifest
    for name in (*manifest["sources"], *manifest["headers"]):
        assert (tmp_path / "out" / name).is_file()
    source = (tmp_path / "out" / manifest["sources"][0]).read_text()
    header = (tmp_path / "out" / manifest["headers"][0]).read_text()
    assert "firmloop generate tank_heater.toml" in source + header
    assert str(tmp_path) not in source


@pytest.mark.parametrize("name", ["evil */ int x; /*.toml", "café.toml", "a\nb.toml"])
def test_no_file_name_reaches_the_c(name: str, project: Path, tmp_path: Path) -> None:
    renamed = project.parent / name.replace("/", "")
    project.rename(renamed)
    assert main(["generate", str(renamed), "--out", str(tmp_path / "out")]) == 0
    assert "firmloop generate PROJECT.toml" in (tmp_path / "out" / "tank_heater" / "src" / "tank_heater.h").read_text()


def test_same_project_same_bytes(project: Path, tmp_path: Path) -> None:
    for folder in ("one", "two"):
        assert main(["generate", str(project), "--out", str(tmp_path / folder)]) == 0
    files = [path for path in (tmp_path / "one").rglob("*") if path.is_file()]
    assert len(files) > 10
    for path in files:
        assert path.read_bytes() == (tmp_path / "two" / path.relative_to(tmp_path / "one")).read_bytes()


def test_targets(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["targets"]) == 0
    assert "qemu_mps2_an386" in capsys.readouterr().out
    assert main(["targets", "--json"]) == 0
    assert {"host", "qemu_mps2_an386"} <= {entry["name"] for entry in _documents(capsys)["targets"]}


def test_doctor_tells_what_is_missing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    fake = tmp_path / "gcc"
    fake.write_text("#!/bin/sh\necho 'gcc 1.0'\n")
    fake.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    assert main(["doctor"]) == 3
    said = capsys.readouterr().out
    assert "gcc 1.0" in said and "MISSING: apt-get install qemu-system-arm" in said
    assert [tool.name for tool in survey() if tool.version] == ["gcc"]


def test_doctor_survives_a_tool_that_does_not_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for name, text in (
        ("gcc", "#!/bin/sh\nexit 1\n"),
        ("qemu-system-arm", "no program"),
        ("arm-none-eabi-gcc", "#!/none\n"),
    ):
        (tmp_path / name).write_text(text)
        (tmp_path / name).chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    assert main(["doctor", "--json"]) == 3
    assert [tool["version"] for tool in _documents(capsys)["tools"]] == [None] * 4


BAD_COMMANDS = (
    [],
    ["fly"],
    ["autotune", "p.toml", "--out", "o"],
    ["run"],
    ["run", "p.toml"],
    ["run", "p.toml", "--out"],
    ["run", "p.toml", "--out", ""],
    ["run", "p.toml", "--out", "o", "--steps", "0"],
    ["run", "p.toml", "--out", "o", "--steps", "-5"],
    ["run", "p.toml", "--out", "o", "--steps", "many"],
    ["run", "p.toml", "--out", "o", "--steps", "9" * 5000],
    ["run", "p.toml", "--out", "o", "--seed", "x"],
    ["run", "p.toml", "--out", "o", "--fast"],
    ["run", "p.toml", "--out", "o", "--step", "5"],
    ["generate", "p.toml", "--out", "o", "--target", "host"],
    ["simulate", "p.toml", "--out", "o.csv"],
    ["targets", "host"],
)


@pytest.mark.parametrize("command", BAD_COMMANDS, ids=" ".join)
def test_bad_command(command: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(command)
    assert ended.value.code == 2
    said = capsys.readouterr()
    assert said.out == "" and len(said.err.splitlines()) == 1 and said.err.startswith("firmloop: ")


def test_unknown_target_on_the_command_line(project: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["verify", str(project), "--out", str(tmp_path / "out"), "--target", "moon"]) == 2
    said = capsys.readouterr()
    assert "'moon'" in said.err and len(said.err.splitlines()) == 1


def _run(arguments: list[str], **environment: str) -> subprocess.CompletedProcess[str]:
    kept = {**os.environ, "PYTHONPATH": str(ROOT), **environment}
    command = [sys.executable, "-m", "firmloop", *arguments]
    return subprocess.run(command, capture_output=True, text=True, env=kept, timeout=600, check=False)


def test_as_a_program(project: Path, tmp_path: Path) -> None:
    assert _run(["--help"]).returncode == 0
    assert _run(["--version"]).stdout.startswith("firmloop ")
    wrong = _run(["generate", str(tmp_path / "none.toml"), "--out", str(tmp_path / "out")], LC_ALL="C")
    assert wrong.returncode == 2 and wrong.stdout == "" and len(wrong.stderr.splitlines()) == 1


def test_nobody_reads_the_output(project: Path, tmp_path: Path) -> None:
    command = f"'{sys.executable}' -m firmloop targets | true; exit ${{PIPESTATUS[0]}}"
    done = subprocess.run(["bash", "-c", f"sleep 0; {command}"], capture_output=True, text=True, cwd=ROOT, check=False)
    assert done.stderr == "" and done.returncode in (0, 141)


def test_gcc_is_missing(project: Path, tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    environment = {"PATH": str(tmp_path / "empty"), "XDG_CACHE_HOME": str(tmp_path / "cache")}
    done = _run(["identify", str(project), "--out", str(tmp_path / "out")], **environment)
    assert done.returncode == 3 and done.stdout == ""
    assert "gcc is not installed" in done.stderr and "apt-get install gcc" in done.stderr
    assert len([line for line in done.stderr.splitlines() if " after " not in line]) == 1  # without progress
    assert not (tmp_path / "out").exists()


def test_a_fault_of_ours_is_one_line(
    project: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def broken(path: Path) -> None:
        raise ZeroDivisionError("a bug\non two lines")

    monkeypatch.setattr("firmloop.door.load.read_project", broken)
    arguments = ["generate", str(project), "--out", str(tmp_path / "out")]
    assert main(arguments) == 70
    said = capsys.readouterr().err
    assert (
        said.startswith("firmloop: internal error: ZeroDivisionError: a bug on two lines")
        and len(said.splitlines()) == 1
    )
    monkeypatch.setenv("FIRMLOOP_DEBUG", "1")
    assert main(arguments) == 70
    assert "Traceback" in capsys.readouterr().err


def test_terminated_in_the_middle(project: Path, tmp_path: Path) -> None:
    arguments = [
        sys.executable,
        "-m",
        "firmloop",
        "verify",
        str(project),
        "--out",
        str(tmp_path / "out"),
        "--steps",
        "50000000",
    ]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    process = subprocess.Popen(arguments, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment)
    assert process.stdout
    process.stdout.readline()  # the C is there, the verification has begun
    process.terminate()
    _, said = process.communicate(timeout=600)
    assert process.returncode == 130
    assert said.splitlines()[-1] == "firmloop: stopped; nothing was left half-written"
    assert [path.name for path in tmp_path.iterdir()] == ["bench"]


@pytest.mark.parametrize("imports", [False, True], ids=["", "while a library is imported"])
def test_interrupted(
    imports: bool, project: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupted(path: Path) -> None:
        try:
            raise KeyboardInterrupt
        except KeyboardInterrupt as error:
            if not imports:
                raise
            raise ImportError("the core failed to import") from error

    monkeypatch.setattr("firmloop.door.load.read_project", interrupted)
    assert main(["generate", str(project), "--out", str(tmp_path / "out")]) == 130
    assert capsys.readouterr().err == "firmloop: stopped; nothing was left half-written\n"

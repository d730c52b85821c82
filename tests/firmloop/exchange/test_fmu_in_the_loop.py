"""A loop closed by an FMU: the plant that was exported gives the run of its own equations; what cannot be is named."""

from __future__ import annotations

import json
import os
import zipfile
from pathlib import Path

import pytest

from firmloop.cli import main
from tests.firmloop.exchange.test_plant_fmu import MOTOR

CONTROLLER = """\
[controller]
kind = "pid"
period_s = 0.001
kp = 0.02
ki = 0.5
tt_s = 0.05

[signals]
reference = { unit = "rad/s", low = -300, high = 300 }
measurement = { unit = "rad/s", low = -400, high = 400 }
output = { unit = "V", low = -12, high = 12 }

[arithmetic]
number = "float32"
"""


@pytest.fixture
def project(tmp_path: Path) -> Path:
    file = tmp_path / "p.toml"
    file.write_text(MOTOR + CONTROLLER)
    return file


@pytest.fixture
def fmu(project: Path, tmp_path: Path) -> Path:
    out = tmp_path / "motor.fmu"
    assert main(["export", str(project), "--fmu", "--of", "plant", "--out", str(out)]) == 0
    return out


CORE = "qemu_mps2_an386"


def verified(project: Path, *more: str) -> tuple[int, dict[str, object], Path]:
    out = project.parent / "out"
    status = main(["verify", str(project), "--steps", "2000", "--out", str(out), "--target", CORE, *more])
    written = out / "verdict.json"
    return status, json.loads(written.read_text()) if status == 0 else {}, out


@pytest.mark.qemu
def test_the_exported_plant_closes_the_loop_as_its_equations_do(
    project: Path, fmu: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("fmpy", reason="FMPy is not installed (pip install fmpy)")
    status, verdict, _ = verified(project, "--fmu", str(fmu))
    said = capsys.readouterr().out
    assert status == 0 and "1,000 steps against motor.fmu, the same bits as on the host" in said
    assert verdict["closed_loop"] == {"steps": 1000, "differences": 0, "against": "motor.fmu"}


@pytest.mark.qemu
def test_the_run_against_an_fmu_has_the_bits_of_the_run_against_the_plant(project: Path, fmu: Path) -> None:
    pytest.importorskip("fmpy", reason="FMPy is not installed (pip install fmpy)")
    import firmloop

    runs = [
        firmloop.verify(firmloop.load(project), targets=[CORE], steps=2000, fmu=file).verdicts[CORE].closed_loop
        for file in (None, fmu)
    ]
    assert runs[0] is not None and runs[1] is not None
    assert runs[0].measurement == runs[1].measurement and runs[0].command == runs[1].command
    assert max(runs[0].measurement) > 30.0


def changed(fmu: Path, old: str, new: str) -> Path:
    """Write the FMU with other descriptions."""
    other = fmu.with_name("other.fmu")
    with zipfile.ZipFile(fmu) as archive, zipfile.ZipFile(other, "w") as made:
        for name in archive.namelist():
            text = archive.read(name).decode()
            made.writestr(name, text.replace(old, new) if name.endswith(".xml") else text)
    return other


MORE = "".join(f'<!ENTITY a{k} "{"&a;" * 10}">' for k in range(1, 9))
WRONG = {
    "a model that is a path": ('modelIdentifier="', 'modelIdentifier="../../', "is no name of C"),
    "a source that is not in it": ('SourceFile name="', 'SourceFile name="../../', "is not in it"),
    "another name": ('name="voltage_V"', 'name="volts"', "has no input 'voltage_V'; it has volts: say which"),
    "no co-simulation": ("CoSimulation", "ModelExchange", "other.fmu: "),
    "an entity that is a file": ("?>\n", '?>\n<!DOCTYPE x [<!ENTITY e SYSTEM "/etc/hostname">]>\n', "a document type"),
    "entities that grow": ("?>\n", f'?>\n<!DOCTYPE x [<!ENTITY a "{"a" * 99}">{MORE}]>\n', "a document type"),
    "no XML": ("<fmiModelDescription", "<fmi", "is not as its standard says"),
}


@pytest.mark.parametrize("case", WRONG)
def test_an_fmu_that_cannot_be_the_plant_is_refused(
    case: str, project: Path, fmu: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("fmpy", reason="FMPy is not installed (pip install fmpy)")
    old, new, words = WRONG[case]
    status, _, _ = verified(project, "--fmu", str(changed(fmu, old, new)))
    said = capsys.readouterr().err
    assert status == 2 and words in said and "Traceback" not in said


@pytest.mark.parametrize("content", [None, b"", b"PK\x03\x04 no archive", b"time_s,speed\n"])
def test_a_file_that_is_no_fmu_is_refused(
    content: bytes | None, project: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("fmpy", reason="FMPy is not installed (pip install fmpy)")
    file = tmp_path / "x.fmu"
    if content is not None:
        file.write_bytes(content)
    assert verified(project, "--fmu", str(file))[0] == 2
    assert "x.fmu: is no FMU that can be read" in capsys.readouterr().err


def test_an_fmu_that_unpacks_to_any_size_or_never_ends_is_refused(
    project: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("fmpy", reason="FMPy is not installed (pip install fmpy)")
    pipe, bomb = tmp_path / "pipe.fmu", tmp_path / "bomb.fmu"
    os.mkfifo(pipe)
    with zipfile.ZipFile(bomb, "w", zipfile.ZIP_DEFLATED) as archive, archive.open("resources/0", "w") as member:
        for _ in range(300):
            member.write(bytes(1 << 20))
    many = tmp_path / "many.fmu"
    with zipfile.ZipFile(many, "w") as archive:
        for k in range(10_001):
            archive.writestr(f"resources/{k}", "")
    tried = ((pipe, "it is no file"), (bomb, "unpacks to 314,572,800 bytes"), (many, "it holds 10,001 files"))
    for file, words in tried:
        assert verified(project, "--fmu", str(file))[0] == 2
        assert words in capsys.readouterr().err


def test_an_fmu_with_no_target_that_closes_a_loop_is_refused(
    project: Path, fmu: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = str(project.parent / "out")
    assert main(["verify", str(project), "--out", out, "--target", "host", "--fmu", str(fmu)]) == 2
    assert "the loop is closed on emulated cores and on boards, and host is none" in capsys.readouterr().err


def test_a_project_without_a_loop_is_refused(project: Path, fmu: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("fmpy", reason="FMPy is not installed (pip install fmpy)")
    filter_alone = '[controller]\nkind = "notch"\nperiod_s = 0.001\nfrequency_hz = 10.0\n[signals]\n'
    wires = "".join(f'{name} = {{ unit = "V", low = -9, high = 9 }}\n' for name in ("measurement", "output"))
    project.write_text(f'schema = 1\nname = "motor"\n{filter_alone}{wires}[arithmetic]\nnumber = "float32"\n')
    assert verified(project, "--fmu", str(fmu))[0] == 2
    assert "it closes no loop that an FMU could be the plant of" in capsys.readouterr().err

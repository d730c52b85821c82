"""A source FMU of every controller kind answers, in FMPy, with the bits of the reference."""

from __future__ import annotations

import subprocess
import xml.etree.ElementTree
import zipfile
from pathlib import Path

import numpy as np
import pytest

from firmloop.cli import main
from firmloop.codegen.bundle import write_files
from firmloop.codegen.emit import emit
from firmloop.codegen.fmu import fmu_files
from firmloop.codegen.view import physical
from firmloop.design.kinds import kinds
from firmloop.quantize.lower.lower import lower
from firmloop.quantize.program import Program, QuantizeError
from firmloop.verify.reference import run
from firmloop.verify.stimuli.settings import requests
from firmloop.verify.stimuli.stimuli import characters
from tests.firmloop.conftest import PROJECT

COMMAND = "firmloop export p.toml"
LANES = 1


def exported(project: Path, out: Path) -> dict[str, str]:
    assert main(["export", str(project), "--fmu", "--out", str(out)]) == 0
    with zipfile.ZipFile(out) as archive:
        return {name: archive.read(name).decode() for name in archive.namelist()}


def test_an_export_describes_the_signals_of_the_project(project: Path, tmp_path: Path) -> None:
    files = exported(project, tmp_path / "a.fmu")
    assert exported(project, tmp_path / "b.fmu") == files
    assert (tmp_path / "a.fmu").read_bytes() == (tmp_path / "b.fmu").read_bytes()
    root = xml.etree.ElementTree.fromstring(files["modelDescription.xml"])
    assert (root.attrib["fmiVersion"], root.attrib["modelName"]) == ("3.0", "tank_heater")
    variables = {each.attrib["name"]: each.attrib for each in root.find("ModelVariables") or ()}
    assert list(variables) == ["time", "reference", "measurement", "output", "status_word"]
    assert (variables["measurement"]["causality"], variables["measurement"]["unit"]) == ("input", "degC")
    assert (variables["output"]["min"], variables["output"]["max"]) == ("-12.0", "12.0")
    token = root.attrib["instantiationToken"]
    assert f'#define TANK_HEATER_PROGRAM_ID "{token}"' in files["sources/tank_heater.h"]
    build = xml.etree.ElementTree.fromstring(files["sources/buildDescription.xml"])
    listed = {f"sources/{each.attrib['name']}" for each in build.iter("SourceFile")}
    assert listed == {name for name in files if name.endswith(".c")}
    assert next(build.iter("SourceFileSet")).attrib["compilerOptions"] == "-ffp-contract=off"


@pytest.mark.parametrize(
    ("more", "words"), [("x.zip", "ends in .fmu"), (None, "--fmu")], ids=["another ending", "no form"]
)
def test_an_export_that_is_not_described_is_refused(
    more: str | None, words: str, project: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["--fmu", "--out", str(tmp_path / more)] if more else ["--out", str(tmp_path / "x.fmu")]
    try:
        status = main(["export", str(project), *arguments])
    except SystemExit as ended:
        status = int(ended.code or 0)
    assert status == 2 and words in capsys.readouterr().err


def test_a_signal_called_like_a_variable_of_every_fmu_is_refused(
    project: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    project.write_text(
        PROJECT.replace("[signals]", '[signals]\ntime = { unit = "s", low = 0, high = 1 }')
        .replace('kind = "pid"', 'kind = "state_space"\nA = [[0.5]]\nB = [[1, 1, 1]]\nC = [[1]]\nD = [[0, 0, 0]]')
        .replace("kp = 0.8\nki = 0.5\n", "x_min = [-300]\nx_max = [300]\n")
    )
    assert main(["export", str(project), "--fmu", "--out", str(tmp_path / "x.fmu")]) == 2
    assert "'time' is a variable of every FMU" in capsys.readouterr().err


PROGRAMS = [(name, arithmetic) for name in kinds() for arithmetic in ("float32", "fixed16")]


def replayed(program: Program, folder: Path, steps: int) -> tuple[int, int]:
    """Run every lane of every character of stimulus in FMPy; return how many values were compared, and differed."""
    fmpy = pytest.importorskip("fmpy", reason="FMPy is not installed (pip install fmpy)")
    slaves = pytest.importorskip("fmpy.fmi3")
    write_files(fmu_files(program, emit(program, COMMAND), COMMAND), folder)
    library = folder / "binaries" / slaves.platform_tuple / f"{program.name}{fmpy.sharedLibraryExtension}"
    library.parent.mkdir(parents=True)
    headers = Path(fmpy.__file__).parent / "c-code"
    sources = [str(path) for path in (folder / "sources").glob("*.c")]
    warnings = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic"]
    compiled = ["gcc", *warnings, "-O2", "-ffp-contract=off", "-fPIC", "-shared", f"-I{headers}", *sources]
    done = subprocess.run([*compiled, "-o", str(library)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    inputs = np.concatenate([block.inputs for block in characters(program, LANES, steps, 1)])
    settings = requests(program, np.random.default_rng(1), *inputs.shape[:2])
    trace = run(program, inputs, settings)
    description = fmpy.read_model_description(str(folder), validate=True)
    known = {each.name: each.valueReference for each in description.modelVariables}
    given = [known[v.name] for v in program.inputs]
    tuned = [known[v.name] for v in program.parameters]
    read = [known[v.name] for v in program.outputs]
    slave = slaves.FMU3Slave(
        guid=description.guid,
        unzipDirectory=str(folder),
        modelIdentifier=program.name,
        instanceName="one",
    )
    slave.instantiate()
    count = wrong = 0
    for lane in range(len(inputs)):
        slave.reset()
        slave.enterInitializationMode(startTime=0.0)
        slave.exitInitializationMode()
        for step in range(inputs.shape[1]):
            for references, values, raw in (
                (tuned, program.parameters, settings[lane, step]),
                (given, program.inputs, inputs[lane, step]),
            ):
                if references:
                    slave.setFloat64(references, [physical(x, v.number) for v, x in zip(values, raw, strict=True)])
            slave.doStep(step * program.period, program.period)
            got = np.array([*slave.getFloat64(read), *slave.getUInt32([known["status_word"]])])
            expected = [physical(x, v.number) for v, x in zip(program.outputs, trace.outputs[lane, step], strict=True)]
            wanted = np.array([*expected, int(trace.status[lane, step])], dtype=np.float64)
            count += len(got)
            wrong += int(np.sum(got.view(np.uint64) != wanted.view(np.uint64)))
    slave.terminate()
    slave.freeInstance()
    return count, wrong


@pytest.mark.parametrize(("name", "arithmetic"), PROGRAMS)
def test_fmpy_gets_the_bits_of_the_reference(name: str, arithmetic: str, tmp_path: Path) -> None:
    try:
        program = lower(kinds()[name].design(kinds()[name].example).law, arithmetic)
    except QuantizeError as error:
        pytest.skip(str(error))
    count, wrong = replayed(program, tmp_path, 20)
    assert count > 200 and wrong == 0


@pytest.mark.slow
@pytest.mark.parametrize("name", kinds())
def test_fmpy_gets_the_bits_of_the_reference_over_a_hundred_thousand_steps(name: str, tmp_path: Path) -> None:
    program = lower(kinds()[name].design(kinds()[name].example).law, "float32")
    count, wrong = replayed(program, tmp_path, 100_000 // len(characters(program, LANES, 2, 1)) + 1)
    assert count > 100_000 and wrong == 0

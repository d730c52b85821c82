"""What travels beside the C works: the vector test builds and passes, fails on a wrong controller, CMake runs it."""

from __future__ import annotations

import csv
import json
import subprocess
from pathlib import Path

import numpy as np
import pytest

from firmloop.codegen.bundle import write_files
from firmloop.codegen.delivery import Delivery
from firmloop.codegen.emit import emit
from firmloop.codegen.packages import formats, package
from firmloop.identify.simulation.compiler import run_compiler
from firmloop.quantize.lower.lower import ARITHMETICS, lower
from firmloop.quantize.program import Program
from firmloop.verify.build.host import WARNINGS
from firmloop.verify.stimuli.vectors import golden
from tests.laws import FULL, pid

COMMAND = "firmloop generate motor_pid.toml"


def written(arithmetic: str, folder: Path) -> Program:
    """Write the folder to copy as `folder`, without the name of the program above it."""
    program = lower(pid(FULL), arithmetic)
    bundle = emit(program, COMMAND)
    inputs, settings, trace = golden(program)
    delivery = Delivery(program, bundle, COMMAND, inputs, settings, trace.outputs, trace.status)
    files = package(delivery)
    write_files({name.removeprefix("motor_pid/"): text for name, text in files.items()}, folder)
    return program


def outcome(folder: Path) -> tuple[int, str]:
    sources = ["src/motor_pid.c", "test/motor_pid_test.c"]
    run_compiler(["gcc", *WARNINGS, "-Isrc", "-O2", "-ffp-contract=off", "-o", "vectors", *sources], folder)
    done = subprocess.run([str(folder / "vectors")], capture_output=True, text=True, timeout=600, check=False)
    return done.returncode, done.stdout


@pytest.mark.parametrize("arithmetic", ARITHMETICS)
def test_the_vector_test_passes_and_catches_a_wrong_gain(arithmetic: str, tmp_path: Path) -> None:
    written(arithmetic, tmp_path)
    rows = len((tmp_path / "test" / "vectors.csv").read_text().splitlines()) - 1
    status, said = outcome(tmp_path)
    assert rows > 400 and status == 0 and f"{rows} steps agree" in said
    source = tmp_path / "src" / "motor_pid.c"
    line = next(line for line in source.read_text().splitlines() if "const" in line and " unlimited = " in line)
    wrong = line.replace(" unlimited = ", " unlimited = 4096 + ")
    source.write_text(source.read_text().replace(line, wrong))
    status, said = outcome(tmp_path)
    assert status == 1 and "differs" in said


@pytest.mark.parametrize("arithmetic", ARITHMETICS)
def test_the_vectors_are_what_the_reference_computes(arithmetic: str, tmp_path: Path) -> None:
    program = written(arithmetic, tmp_path)
    inputs, _, trace = golden(program)
    with (tmp_path / "test" / "vectors.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    assert list(rows[0]) == ["start", "reference", "measurement", "output", "status"]
    read = float.fromhex if arithmetic.startswith("float") else int
    got = np.array([[read(row[name]) for name in ("reference", "measurement", "output")] for row in rows])
    expected = np.concatenate([inputs.reshape(-1, 2), trace.outputs.reshape(-1, 1)], axis=1)
    np.testing.assert_array_equal(got, expected)
    assert [int(row["status"]) for row in rows] == trace.status.ravel().tolist()
    assert sum(int(row["start"]) for row in rows) == len(inputs)
    assert len({row["status"] for row in rows}) > 1, "limits are among them"


def test_every_format_prints_files_of_its_own() -> None:
    program = lower(pid(FULL), "fixed16")
    inputs, settings, trace = golden(program)
    made = Delivery(program, emit(program, COMMAND), COMMAND, inputs, settings, trace.outputs, trace.status)
    printed = {name: set(files(made)) for name, files in formats().items()}
    whole = {f"motor_pid/{name}" for name in set().union(*printed.values(), {"src/motor_pid.c", "src/motor_pid.h"})}
    assert all(printed.values()) and whole | {"motor_pid/src/fl_fixed.h"} == set(package(made))


def test_the_same_program_gives_the_same_files(tmp_path: Path) -> None:
    for name in ("one", "two"):
        written("fixed32", tmp_path / name)
    one, two = (
        {
            path.relative_to(tmp_path / name): path.read_bytes()
            for path in (tmp_path / name).rglob("*")
            if path.is_file()
        }
        for name in ("one", "two")
    )
    assert one == two


def test_the_compilation_database_names_files_that_are_there(tmp_path: Path) -> None:
    written("float32", tmp_path)
    for entry in json.loads((tmp_path / "compile_commands.json").read_text()):
        run_compiler(["gcc", *entry["arguments"][1:]], tmp_path / entry["directory"])

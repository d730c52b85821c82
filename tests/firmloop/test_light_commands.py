"""A command imports what it needs and no more: the heavy libraries of each, and how little the quick ones load."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
from pathlib import Path

import pytest

from firmloop.commands import command_names, load_command

ROOT = Path(__file__).parents[2]
HEAVY = (
    *("numpy", "casadi", "scipy.signal", "scipy.stats", "scipy.optimize", "scipy.integrate", "matplotlib"),
    *("pandas", "nfoursid", "numba", "z3", "h5py", "control", "pyarrow"),
)
LOADED = f"""
import sys
from firmloop.cli import main
try:
    status = main(sys.argv[1:])
except SystemExit as ended:
    status = ended.code
print([status, len(sys.modules), [name for name in {HEAVY!r} if name in sys.modules]], file=sys.stderr)
"""
MODULES = 250  # of commands that only look something up; a bare interpreter has 50, numpy alone brings 150


def loaded(arguments: list[str]) -> tuple[int, int, set[str]]:
    """Run a command in a process of its own; return its status, how many modules it loaded and which heavy ones."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-c", LOADED, *arguments]
    done = subprocess.run(command, capture_output=True, text=True, env=environment, timeout=600, check=False)
    status, modules, names = ast.literal_eval(done.stderr.splitlines()[-1])
    return status or 0, modules, set(names)


@pytest.mark.parametrize(
    "command", ["--version", "--help", "targets", "doctor", "init --help", "generate --help", "diagnose --help"]
)
def test_what_looks_something_up_loads_nothing_heavy(command: str) -> None:
    _, modules, names = loaded(command.split())
    assert names == set() and modules < MODULES


@pytest.mark.parametrize("arithmetic, judges", [("float32", set()), ("fixed", {"z3"})])
def test_generate_loads_what_writes_c(project: Path, tmp_path: Path, arithmetic: str, judges: set[str]) -> None:
    project.write_text(project.read_text().replace('number = "float32"', f'number = "{arithmetic}"'))
    status, _, names = loaded(["generate", str(project), "--out", str(tmp_path / "out")])
    assert status == 0 and names == {"numpy", "casadi"} | judges


def test_simulate_loads_what_simulates(project: Path, tmp_path: Path) -> None:
    recording, out = str(project.parent / "test.csv"), str(tmp_path / "y.csv")
    status, _, names = loaded(["simulate", str(project), recording, "--out", out])
    assert status == 0 and names == {"numpy", "casadi"}


@pytest.mark.parametrize("command", ["identify", "design", "verify"])
def test_only_what_draws_loads_matplotlib(project: Path, tmp_path: Path, command: str) -> None:
    more = ["--steps", "500"] if command == "verify" else []
    status, _, names = loaded([command, str(project), "--out", str(tmp_path / "out"), *more])
    assert status == 0 and not names & {"matplotlib", "pandas", "nfoursid", "h5py", "control", "numba", "pyarrow", "z3"}


def test_a_diagnosis_loads_no_statistics_but_special_functions(project: Path, tmp_path: Path) -> None:
    status, _, names = loaded(["diagnose", str(project), "--out", str(tmp_path / "out")])
    assert status in (0, 1) and not names & {"scipy.signal", "scipy.stats", "scipy.optimize", "pandas", "numba", "z3"}


def test_a_command_is_called_as_its_file() -> None:
    assert len(command_names()) >= 18
    for name in command_names():
        assert load_command(name).NAME == name and load_command(name).HELP

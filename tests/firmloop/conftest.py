"""A small project on disk: a first-order plant that fits in a moment, and its PID."""

from __future__ import annotations

import csv
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from firmloop import console
from firmloop.cli import main

PROJECT = """\
schema = 1
name = "tank_heater"

[recordings]
train = ["train.csv"]
test = ["test.csv"]

[plant]
kind = "first_order"
input = "voltage_V"
outputs = ["temperature_C"]

[plant.parameters]
gain = { value = 1.0, free = true }
time_constant_s = { value = 1.0, free = true }
delay_s = { value = 0.0, free = false }

[controller]
kind = "pid"
period_s = 0.05
kp = 0.8
ki = 0.5

[signals]
reference = { unit = "degC", low = -50, high = 50 }
measurement = { unit = "degC", low = -50, high = 50 }
output = { unit = "V", low = -12, high = 12 }

[arithmetic]
number = "float32"

[target]
names = ["host"]
"""


def recording(seed: int) -> str:
    """A first-order lag of gain 3 and 2 s behind random steps, with a little noise."""
    random = np.random.default_rng(seed)
    drive = np.repeat(random.uniform(-5, 5, 20), 20)
    state, lines = 0.0, ["time_s,voltage_V,temperature_C"]
    for row, u in enumerate(drive):
        lines.append(f"{row * 0.05:.2f},{u:.6g},{state + random.normal(0, 0.02):.6g}")
        state += (1 - np.exp(-0.05 / 2.0)) * (3.0 * u - state)
    return "\n".join(lines) + "\n"


@pytest.fixture(autouse=True)
def no_progress(monkeypatch: pytest.MonkeyPatch) -> None:
    """What takes long on a busy machine says so on stderr; tests that count lines there must not depend on it."""
    monkeypatch.setattr(console, "QUIET", math.inf)


@pytest.fixture(scope="session")
def recorded_files() -> dict[str, str]:
    return {"train.csv": recording(1), "test.csv": recording(2)}


@pytest.fixture
def project(tmp_path: Path, recorded_files: dict[str, str]) -> Path:
    """The project file; its folder holds nothing else than its recordings."""
    folder = tmp_path / "bench"
    folder.mkdir()
    for name, text in recorded_files.items():
        (folder / name).write_text(text)
    path = folder / "tank_heater.toml"
    path.write_text(PROJECT)
    return path


@pytest.fixture
def bench(project: Path, capsys: pytest.CaptureFixture[str]) -> Callable[..., tuple[int, dict[str, np.ndarray], str]]:
    """Read a file by a project with more lines in [recordings]; return status, columns and what was said."""

    def read(content: str | bytes, lines: str = "", name: str = "r.csv") -> tuple[int, dict[str, np.ndarray], str]:
        file = project.parent / name
        file.write_bytes(content.encode() if isinstance(content, str) else content)
        given = project.with_name("given.toml")
        given.write_text(project.read_text().replace("\n[plant]\n", f"\n{lines}\n[plant]\n", 1))
        out = project.parent / "out.csv"
        out.unlink(missing_ok=True)
        capsys.readouterr()
        status = main(["simulate", str(given), str(file), "--out", str(out)])
        said = capsys.readouterr()
        assert "Traceback" not in said.err
        if status:
            assert not out.exists()
            return status, {}, said.err
        with out.open() as stream:
            head, *rows = csv.reader(stream)
        columns = dict(zip(head, np.array(rows, dtype=float).T, strict=True))
        return status, columns, said.out

    return read

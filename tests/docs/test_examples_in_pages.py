"""What the pages show runs: the tutorial's commands, one after the other, and README's Python."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from firmloop.cli import main

ROOT = Path(__file__).parents[2]
FIGURE = r"(?<![A-Za-z_])\d+(?:\.\d+)?(?:e[-+]?\d+)?"
NEAR = (
    0.3  # of a figure: another compiler rounds a fit elsewhere, and noise of noise moves an interval more than a value
)
ENDS = {"firmloop diagnose": 1}  # status of the commands that find something; all others end with 0


def _blocks(page: Path, language: str) -> list[str]:
    """Return the fenced blocks of one language, blank for none."""
    found, inside, lines = [], None, []
    for line in page.read_text(encoding="utf-8").splitlines():
        if not line.startswith("```"):
            lines.append(line)
        elif inside is None:
            inside, lines = line.removeprefix("```"), []
        else:
            found += ["\n".join(lines)] if inside == language else []
            inside = None
    return found


def _run(command: list[str], folder: Path) -> subprocess.CompletedProcess[str]:
    kept = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = [sys.executable, *command]
    return subprocess.run(done, capture_output=True, text=True, cwd=folder, env=kept, timeout=600, check=False)


def _figures(line: str) -> list[float]:
    """Return the figures of a line, without the program's id."""
    return [float(each) for each in re.findall(FIGURE, re.sub(r"\b[0-9a-f]{16}\b", "", line).replace(",", ""))]


def _words(line: str) -> str:
    """Return a line without its figures: columns are as wide as those."""
    return " ".join(re.findall(r"[A-Za-z_]{2,}", re.sub(FIGURE, " ", re.sub(r"\b[0-9a-f]{16}\b", "", line))))


@pytest.mark.qemu
@pytest.mark.cross
def test_the_tutorial_prints_what_it_shows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    page = ROOT / "docs" / "tutorial.md"
    shutil.copytree(ROOT / "examples" / "own_motor", tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    printed = ""
    commands = [line for block in _blocks(page, "sh") for line in block.splitlines()]
    assert len(commands) == 8
    for line in commands:
        program, *rest = line.split()
        status = _run(rest, tmp_path).returncode if program == "python" else main(rest)
        said = capsys.readouterr()
        assert status == ENDS.get(" ".join(line.split()[:2]), 0), f"{line}\n{said.err[-800:]}"
        printed += said.out
    shown = {_words(line): line for line in printed.splitlines()}
    for block in _blocks(page, ""):
        if "--port" in block or block.startswith("t,u"):
            continue  # these need a board, or show a file
        for line in block.splitlines():
            assert _words(line) in shown, f"not printed: {line}"
            assert _figures(line) == pytest.approx(_figures(shown[_words(line)]), rel=NEAR), line
    reports = list((tmp_path / "out").rglob("report.html"))
    assert reports
    for report in reports:
        text = report.read_text(encoding="utf-8")
        assert len(text.encode()) <= 700_000, report
        cells = re.findall(r"<t[dh][^>]*>([^<]*)<", text)
        assert not [cell for cell in cells if any(abs(figure) > 1e8 for figure in _plain_figures(cell))], report


@pytest.mark.qemu
def test_the_scope_runs_on_the_two_files_of_its_page(tmp_path: Path) -> None:
    page = ROOT / "docs" / "scope.md"
    (tmp_path / "tank.toml").write_text(_blocks(page, "toml")[0], encoding="utf-8")
    (tmp_path / "tank.c").write_text(_blocks(page, "c")[0], encoding="utf-8")
    command = _blocks(page, "")[0].split()
    done = _run(["-m", *command, "--seconds", "0.5"], tmp_path)
    assert done.returncode == 0, done.stderr
    assert "open http://127.0.0.1:" in done.stderr and "500 samples of reference, measurement, output" in done.stdout
    header = (tmp_path / "seen.csv").read_text(encoding="utf-8").splitlines()[0]
    assert header == "time_s,reference_degC,measurement_degC,output_V"


def _plain_figures(cell: str) -> list[float]:
    """Return the figures of a cell that holds nothing else: no finding is as large as what stands for none."""
    return [float(each) for each in cell.split() if re.fullmatch(r"-?\d+(\.\d+)?(e[-+]?\d+)?", each)]


def test_the_tutorial_shows_the_project_it_uses() -> None:
    text = (ROOT / "examples" / "own_motor" / "motor.toml").read_text(encoding="utf-8")
    shown = "\n".join(_blocks(ROOT / "docs" / "tutorial.md", "toml"))
    missing = [line for line in text.splitlines() if line.strip() and line not in shown.splitlines()]
    assert missing == [text.splitlines()[0]], "all but the comment on the first line"


def test_the_python_of_readme_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (example,) = _blocks(ROOT / "README.md", "python")
    shutil.copytree(ROOT / "examples" / "wheel_speed", tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {}
    exec(example.replace("fl.verify(", "verified = fl.verify("), names)
    assert names["verified"].agrees
    assert names["fit"]._repr_html_().lstrip().startswith("<")

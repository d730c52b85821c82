"""What the pages show runs: the tutorial's commands, one after the other, and README's Python."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import firmloop

ROOT = Path(__file__).parents[2]
ENDS = {"firmloop diagnose": 1}  # status of the commands that find something; all others end with 0


def _blocks(page: Path, language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", page.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE)


def _run(command: list[str], folder: Path) -> subprocess.CompletedProcess[str]:
    kept = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = [sys.executable, *command]
    return subprocess.run(done, capture_output=True, text=True, cwd=folder, env=kept, timeout=600, check=False)


def _figureless(text: str) -> list[str]:
    """Return the words of a text: its figures are those of one compiler, and columns are as wide as the figures."""
    return re.findall(r"[A-Za-z_]{2,}", re.sub(r"\b[0-9a-f]{16}\b|[-+]?\d[\d.,]*(?:e[-+]?\d+)?", " ", text))


@pytest.mark.qemu
@pytest.mark.cross
def test_the_tutorial_prints_what_it_shows(tmp_path: Path) -> None:
    page = ROOT / "docs" / "tutorial.md"
    shutil.copytree(ROOT / "examples" / "own_motor", tmp_path, dirs_exist_ok=True)
    printed = ""
    commands = [line for block in _blocks(page, "sh") for line in block.splitlines()]
    assert len(commands) == 8
    for line in commands:
        program, *rest = line.split()
        done = _run(rest if program == "python" else ["-m", "firmloop", *rest], tmp_path)
        assert done.returncode == ENDS.get(" ".join(line.split()[:2]), 0), f"{line}\n{done.stderr[-800:]}"
        printed += done.stdout
    said = {" ".join(_figureless(line)) for line in printed.splitlines()}
    for block in _blocks(page, ""):
        if "--port" in block or block.startswith("t,u"):
            continue  # these need a board, or show a file
        for line in block.splitlines():
            assert " ".join(_figureless(line)) in said, f"not printed: {line}"


def test_the_tutorial_shows_the_project_it_uses() -> None:
    text = (ROOT / "examples" / "own_motor" / "motor.toml").read_text(encoding="utf-8")
    shown = "\n".join(_blocks(ROOT / "docs" / "tutorial.md", "toml"))
    missing = [line for line in text.splitlines() if line.strip() and line not in shown.splitlines()]
    assert missing == [text.splitlines()[0]], "all but the comment on the first line"


@pytest.mark.skipif(not hasattr(firmloop, "load"), reason="import firmloop offers no functions yet")
def test_the_python_of_readme_runs(tmp_path: Path) -> None:
    (example,) = _blocks(ROOT / "README.md", "python")
    shutil.copytree(ROOT / "examples" / "wheel_speed", tmp_path, dirs_exist_ok=True)
    (tmp_path / "example.py").write_text(f'{example}\nassert fit._repr_html_().lstrip().startswith("<")\n')
    done = _run(["example.py"], tmp_path)
    assert done.returncode == 0, done.stderr[-2000:]

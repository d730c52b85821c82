"""The GitHub Action is a shell script with inputs: it ends as `firmloop verify` does, and reports where it was told."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import yaml

from tests.firmloop.conftest import PROJECT

ROOT = Path(__file__).parents[2]


def action() -> dict[str, Any]:
    text = (ROOT / "action.yml").read_text(encoding="utf-8")
    found: dict[str, Any] = yaml.safe_load(text)
    return found


@pytest.fixture
def project(tmp_path: Path) -> Path:
    begin, end = PROJECT.index("[recordings]"), PROJECT.index("[controller]")
    path = tmp_path / "my heater.toml"
    path.write_text(PROJECT[:begin] + PROJECT[end:])
    return path


def run(folder: Path, **inputs: str) -> tuple[int, dict[str, str], str]:
    """Run the step as the host does, with every input that is not given at its default."""
    (step, _) = action()["runs"]["steps"]
    given = {name: entry.get("default", "") for name, entry in action()["inputs"].items()} | inputs
    words = {name: value.split("inputs.")[1].split(" ")[0] for name, value in step["env"].items()}
    told, summary = folder / "output", folder / "summary"
    environment = {
        **os.environ,
        **{name: given[key] for name, key in words.items()},
        "GITHUB_ACTION_PATH": str(ROOT),
        "GITHUB_OUTPUT": str(told),
        "GITHUB_STEP_SUMMARY": str(summary),
        "PYTHONPATH": str(ROOT),
        "FIRMLOOP": f"{sys.executable} -m firmloop",
    }
    done = subprocess.run(["bash", "-c", step["run"]], cwd=folder, env=environment, check=False)
    outputs = dict(line.split("=", 1) for line in told.read_text().splitlines()) if told.exists() else {}
    return done.returncode, outputs, summary.read_text() if summary.exists() else ""


def test_it_verifies_and_leaves_both_reports(project: Path, tmp_path: Path) -> None:
    status, outputs, summary = run(tmp_path, project=project.name, steps="500")
    assert (status, outputs["status"]) == (0, "0")
    assert "0 differences: agrees" in summary
    assert "<testsuites>" in (tmp_path / outputs["junit"]).read_text()
    assert json.loads((tmp_path / outputs["sarif"]).read_text())["version"] == "2.1.0"
    assert set(action()["outputs"]) == set(outputs)


def test_it_fails_as_the_command_does(project: Path, tmp_path: Path) -> None:
    status, outputs, _ = run(tmp_path, project=project.name, steps="500", targets="host $(touch broken) none")
    assert status == 2 and outputs == {"status": "2"}
    assert not (tmp_path / "broken").exists()

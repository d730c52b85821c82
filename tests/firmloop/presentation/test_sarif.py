"""`firmloop verify --sarif FILE`: what is found in the C stands at its line, and what was not run says so."""

from __future__ import annotations

import json
import os
import shutil
from pathlib import Path
from typing import Any

import pytest

from firmloop.cli import main
from tests.firmloop.conftest import PROJECT


def verified(project: Path, out: Path, *more: str) -> tuple[int, dict[str, Any]]:
    """Return the status, and each tool's run by its name."""
    report = out / "ci" / "report.sarif"
    arguments = ["verify", str(project), "--out", str(out), "--steps", "500", "--sarif", str(report), *more]
    status = main(arguments)
    document = json.loads(report.read_text())
    assert document["version"] == "2.1.0"
    return status, {run["tool"]["driver"]["name"]: run for run in document["runs"]}


def test_sound_c_has_no_open_finding(project: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    status, runs = verified(project, Path("out"))
    assert status == 0 and list(runs) == ["firmloop", "gcc -fanalyzer", "cppcheck"]
    opened = [one for run in runs.values() for one in run["results"] if not one.get("suppressions")]
    assert not opened
    for name in ("firmloop", "gcc -fanalyzer"):
        assert runs[name]["invocations"] == [{"executionSuccessful": True, "toolExecutionNotifications": []}]


def test_a_tool_that_is_missing_says_so(project: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shutil, "which", lambda name, found=shutil.which: None if name == "cppcheck" else found(name))
    _, runs = verified(project, tmp_path)
    (invocation,) = runs["cppcheck"]["invocations"]
    assert not invocation["executionSuccessful"]
    assert "apt-get install cppcheck" in invocation["toolExecutionNotifications"][0]["message"]["text"]


def test_a_departure_from_misra_carries_its_reason(
    project: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A stand-in that says what cppcheck says: a rule with a reason, one without, and a matter of style."""
    stand_in = tmp_path / "bin" / "cppcheck"
    stand_in.parent.mkdir()
    says = ["misra-c2012-15.5", "misra-c2012-99.9", "knownConditionTrueFalse"]
    lines = "".join(f"tank_heater.c\\t12\\t3\\tstyle\\t{rule}\\tmisra violation\\n" for rule in says)
    stand_in.write_text(f"#!/bin/sh\nprintf '{lines}'\n")
    stand_in.chmod(0o755)
    monkeypatch.setenv("PATH", f"{stand_in.parent}{os.pathsep}{os.environ['PATH']}")
    monkeypatch.chdir(tmp_path)
    _, runs = verified(project, Path("out"))
    known, new = runs["cppcheck"]["results"]
    assert known["level"] == "note" and "a search ends" in known["suppressions"][0]["justification"]
    assert new["level"] == "warning" and "suppressions" not in new
    place = known["locations"][0]["physicalLocation"]
    assert (
        place["artifactLocation"]["uri"] == "out/tank_heater/src/tank_heater.c" and place["region"]["startLine"] == 12
    )
    assert (tmp_path / place["artifactLocation"]["uri"]).is_file()


def test_c_that_differs_or_warns_is_found(project: Path, tmp_path: Path, wrong_output: None) -> None:
    status, runs = verified(project, tmp_path)
    (found,) = runs["firmloop"]["results"]
    assert status == 1 and (found["ruleId"], found["level"]) == ("differs-from-reference", "error")
    assert "host: " in found["message"]["text"] and "steps differ" in found["message"]["text"]


def test_the_analyzer_finds_what_no_run_meets() -> None:
    from firmloop.codegen.bundle import Bundle
    from firmloop.verify.build.static_checks import read_statically

    text = "#include <stddef.h>\nint f(int a);\nint f(int a)\n{\n    int *p = NULL;\n    return (a > 0) ? *p : a;\n}\n"
    analyzer = read_statically(Bundle("f", "0", {"f.c": text}, ("f.c",), ()))[0]
    assert [(each.file, each.line) for each in analyzer.findings] == [("f.c", 6)]
    assert "NULL" in analyzer.findings[0].says


def test_what_was_not_run_is_told(project: Path, tmp_path: Path) -> None:
    project.write_text(PROJECT.replace('names = ["host"]', 'names = ["nucleo_f401re"]'))
    status, runs = verified(project, tmp_path, "--port", str(tmp_path / "no_port"))
    (invocation,) = runs["firmloop"]["invocations"]
    assert status == 3 and not invocation["executionSuccessful"]
    assert "nucleo_f401re was not run" in invocation["toolExecutionNotifications"][0]["message"]["text"]

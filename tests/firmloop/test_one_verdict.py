"""No target agrees whose C is undefined or differs on this machine; what is missing is told from what was found."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import jsonschema
import pytest

from firmloop.cli import main
from firmloop.codegen.bundle import Bundle
from firmloop.stages import making
from firmloop.verify import trial
from firmloop.verify.build import sanitized

SCHEMA = json.loads((Path(__file__).parents[1] / "schema" / "verdict.schema.json").read_text())
QEMU = "qemu_mps2_an386"
FAULTS = {  # the value that each leaves is not used, so that every core makes the same of the step
    "shift": (
        "volatile int32_t by = 36; volatile int32_t left = 5 >> by; (void)left;",
        "shift exponent 36 is too large",
    ),
    "overflow": ("volatile int32_t far = INT32_MAX; far = far + 1; (void)far;", "signed integer overflow"),
    "bounds": ("volatile float a[3] = { 0.0F }; volatile int32_t at = 3; (void)a[at];", "index 3 out of bounds"),
    "memory": ("volatile float a[3] = { 0.0F }; volatile float *volatile p = a; (void)p[3];", "stack-buffer-overflow"),
    "cast": ("volatile float far = 3e9F; volatile int32_t into = (int32_t)far; (void)into;", "outside the range"),
}
Plant = Callable[[str], None]


@pytest.fixture
def plant(monkeypatch: pytest.MonkeyPatch) -> Plant:
    """Put a line at the start of step(), in the C that is generated from then on."""
    sound = making.emit

    def set_line(line: str) -> None:
        def planted(*given: object) -> Bundle:
            bundle = sound(*given)  # type: ignore[arg-type]
            source = bundle.sources[0]
            text, count = re.subn(
                r"(uint32_t tank_heater_step\([^{;]*\{\n)", lambda m: f"{m[1]}    {line}\n", bundle.files[source]
            )
            assert count == 1
            return replace(bundle, files={**bundle.files, source: text})

        monkeypatch.setattr(making, "emit", planted)

    return set_line


def verified(project: Path, out: Path, target: str, *more: str) -> tuple[int, dict[str, Any]]:
    arguments = ["verify", str(project), "--out", str(out), "--target", target, "--steps", "2000", *more]
    status = main(arguments)
    verdict = json.loads((out / "verdict.json").read_text())
    jsonschema.validate(verdict, SCHEMA)
    return status, verdict


@pytest.mark.parametrize("target", ["host", QEMU])
@pytest.mark.parametrize("fault", FAULTS)
def test_undefined_behavior_is_a_find_on_every_target(
    fault: str, target: str, project: Path, tmp_path: Path, plant: Plant, capsys: pytest.CaptureFixture[str]
) -> None:
    line, words = FAULTS[fault]
    plant(line)
    status, verdict = verified(project, tmp_path / "out", target)
    said = capsys.readouterr()
    found = verdict["undefined_behavior"]
    assert (status, verdict["verdict"], verdict["target"]) == (1, "differs", target)
    assert words in found["says"] and found["operation"] == line and found["file"] == "tank_heater.c"
    text = (tmp_path / "out" / "tank_heater" / "src" / "tank_heater.c").read_text().splitlines()
    assert text[found["line"] - 1].strip() == line
    assert f"undefined behavior: tank_heater.c:{found['line']}: " in said.out and "DIFFERS" in said.out
    assert "NOT RUN" not in said.out and "not run" not in said.err
    assert str(tmp_path) not in found["says"] and "0x" not in found["says"]  # the same words in every run


def test_without_the_sanitizers_that_c_would_agree(
    project: Path, tmp_path: Path, plant: Plant, monkeypatch: pytest.MonkeyPatch
) -> None:
    plant(FAULTS["shift"][0])
    nothing = sanitized.Sanitized(1, 0, None, None, "")
    monkeypatch.setattr(trial, "compare_sanitized", lambda *given: nothing)
    status, verdict = verified(project, tmp_path / "out", "host")
    assert (status, verdict["verdict"]) == (0, "agrees")


def test_the_step_that_was_stopped_is_named(project: Path, tmp_path: Path, plant: Plant) -> None:
    plant("static int32_t calls = INT32_MAX - 1234; calls = calls + 1;")
    _, verdict = verified(project, tmp_path / "out", "host")
    assert verdict["sanitized_steps"] == 1234 and verdict["first_difference"]["step"] == 1234
    assert "undefined behavior" in verdict["first_difference"]["operation"]


def test_the_environment_does_not_silence_the_sanitizers(
    project: Path, tmp_path: Path, plant: Plant, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("UBSAN_OPTIONS", "exitcode=0:halt_on_error=0:suppressions=/dev/null")
    monkeypatch.setenv("ASAN_OPTIONS", "exitcode=0:halt_on_error=0")
    plant(FAULTS["memory"][0])
    status, verdict = verified(project, tmp_path / "out", "host")
    assert status == 1 and verdict["undefined_behavior"]


def test_this_machine_is_tried_once_for_all_targets(
    project: Path, tmp_path: Path, plant: Plant, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    calls = []
    run = trial.run_sanitized
    monkeypatch.setattr(trial, "run_sanitized", lambda *given: calls.append(1) or run(*given))  # type: ignore[func-returns-value]
    plant(FAULTS["shift"][0])
    project.write_text(project.read_text().replace('["host"]', f'["host", "{QEMU}"]'))
    assert main(["run", str(project), "--out", str(tmp_path / "out"), "--steps", "2000"]) == 1
    page = (tmp_path / "out" / "report.html").read_text()
    assert calls == [1] and page.count("DIFFERS") >= 2
    assert capsys.readouterr().out.count("undefined behavior: tank_heater.c:") == 2
    assert '<th scope="row">sanitizers</th><td class=long>undefined behavior: tank_heater.c:' in page


def test_missing_sanitizers_are_said_and_are_no_find(
    project: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def without(*given: object) -> Path:
        raise sanitized.ToolError("gcc failed with status 1:\n/usr/bin/ld: cannot find -lasan: No such file")

    monkeypatch.setattr(sanitized, "built", without)
    status, verdict = verified(project, tmp_path / "out", "host")
    said = capsys.readouterr()
    assert (status, verdict["differences"], verdict["sanitized_steps"]) == (3, 0, 0)
    assert "install" in verdict["sanitizers_not_run"] and verdict["undefined_behavior"] is None
    assert "NOT RUN: this gcc has no sanitizers" in said.out and "the sanitizers were not run" in said.err


def test_a_program_that_does_not_end_is_called_so(
    project: Path, tmp_path: Path, plant: Plant, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """It is slow under the sanitizers only."""
    monkeypatch.setattr(sanitized, "LONGEST_RUN", 1.0)
    plant("\n#ifdef __SANITIZE_ADDRESS__\n    for (volatile int32_t k = 0; k < 1;) { }\n#endif\n")
    status, verdict = verified(project, tmp_path / "out", "host")
    assert status == 3 and verdict["undefined_behavior"] is None and verdict["differences"] == 0
    assert "did not end within 1 s" in verdict["sanitizers_not_run"]
    assert "did not end within 1 s" in capsys.readouterr().out


def test_a_sanitizer_that_cannot_start_is_no_find(
    project: Path, tmp_path: Path, plant: Plant, capsys: pytest.CaptureFixture[str]
) -> None:
    plant("\n#ifdef __SANITIZE_ADDRESS__\n    extern void _exit(int); _exit(127);\n#endif\n")
    status, verdict = verified(project, tmp_path / "out", "host")
    assert status == 3 and verdict["undefined_behavior"] is None and verdict["verdict"] == "agrees"
    assert "could not run: it ended with status 127" in capsys.readouterr().out


@pytest.mark.qemu
def test_a_core_does_not_agree_where_this_machine_differs(project: Path, tmp_path: Path, plant: Plant) -> None:
    """The C is right on the core alone."""
    plant("\n#ifndef __arm__\n    if (in->reference > 50.0F) { self->integral = 0.0F; }\n#endif\n")
    status, verdict = verified(project, tmp_path / "out", QEMU)
    assert (status, verdict["verdict"]) == (1, "differs") and verdict["host"]["differences"] > 0
    assert verdict["first_difference"]["lane"].startswith("on this machine, ")


@pytest.mark.qemu
def test_a_core_that_agrees_says_what_was_done_here(project: Path, tmp_path: Path) -> None:
    status, verdict = verified(project, tmp_path / "out", QEMU)
    assert (status, verdict["verdict"], verdict["undefined_behavior"]) == (0, "agrees", None)
    assert verdict["sanitized_steps"] == verdict["host"]["steps"] == verdict["steps"]
    assert verdict["host"]["any_state_steps"] > 0

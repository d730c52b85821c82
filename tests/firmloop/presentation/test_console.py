"""What a user sees while a command works, and what a machine reads."""

from __future__ import annotations

import json
import re
import subprocess
import sys
import time

import numpy as np
import pytest

from firmloop import console


@pytest.fixture
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(console, "QUIET", 0.02)
    monkeypatch.setattr(console, "REDRAW", 0.01)
    monkeypatch.setattr(console, "PLAIN", 0.01)


def said_until(text: str, capsys: pytest.CaptureFixture[str]) -> str:
    """What is on stderr once `text` is among it, for which a busy machine may take its time."""
    said, deadline = "", time.monotonic() + 60.0
    while text not in said and time.monotonic() < deadline:
        time.sleep(0.01)
        said += capsys.readouterr().err
    return said


def test_short_work_is_silent(capsys: pytest.CaptureFixture[str]) -> None:
    with console.progress("working") as bar:
        bar(0.5, "half")
    assert capsys.readouterr() == ("", "")


def test_long_work_without_a_terminal_is_a_few_lines(impatient: None, capsys: pytest.CaptureFixture[str]) -> None:
    with console.progress("working") as bar:
        bar(0.25, "first half")
        said = said_until("first half", capsys)
    assert re.fullmatch(r"(working: after \d+ s\n)*(working:  25% first half after \d+ s\n)+", said)


def test_long_work_at_a_terminal_is_a_bar_that_goes_away(
    impatient: None, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sys.stderr.isatty", lambda: True, raising=False)
    with console.progress("working") as bar:
        bar(0.5, "")
        said = said_until("50%", capsys)
    said += capsys.readouterr().err
    assert "[############............]  50%" in said
    assert "\n" not in said and said.endswith("\r\x1b[J")  # clears the lines below it, too


def test_json_is_one_document(capsys: pytest.CaptureFixture[str]) -> None:
    machine = console.JsonConsole()
    machine.lines(["for people"])
    machine.result("figure", {"mean": np.float64(1.5), "count": np.int64(3)})
    machine.close()
    said = capsys.readouterr()
    assert json.loads(said.out) == {"schema": 1, "figure": {"mean": 1.5, "count": 3}}
    assert said.err == ""


def test_json_of_a_failure_holds_no_result(capsys: pytest.CaptureFixture[str]) -> None:
    machine = console.JsonConsole()
    machine.result("figure", 3)
    machine.fail("the file is wrong")
    said = capsys.readouterr()
    assert json.loads(said.out) == {"schema": 1, "error": "the file is wrong"}
    assert said.err == "firmloop: the file is wrong\n"


def test_table_aligns_rows_of_any_length() -> None:
    assert console.table([("a", "bb", "c"), ("aaa", "b"), ()]) == ["  a    bb  c", "  aaa  b", ""]
    assert console.table([]) == []


FULL = "firmloop: standard output cannot be written: No space left on device; send it elsewhere\n"
LOST = {"explain pid": (0, 2, 141), "--version": (0, 2, 141), "explain pid --json": (0, 2, 141)}
LOST |= {"explain nothing": (2, 2, 2), "explain nothing --json": (2, 2, 141)}  # a complaint, and one in a document


@pytest.mark.parametrize("asked", LOST)
def test_a_standard_output_that_is_lost_is_no_fault_and_no_other_place_is_blamed(asked: str) -> None:
    late = "import time, firmloop.cli as cli; time.sleep(0.2); raise SystemExit(cli.main())"
    for lost, status in zip((">&-", "2>&-", ">/dev/full", "| true"), (LOST[asked][0], *LOST[asked]), strict=True):
        script = f"{sys.executable} -c '{late}' {asked} {lost}; exit ${{PIPESTATUS[0]}}"
        done = subprocess.run(["bash", "-c", script], capture_output=True, text=True, check=False)
        assert done.returncode == status, (lost, done.stderr)
        told = "explain nothing: no key" in done.stderr
        assert told == ("nothing" in asked and lost != "2>&-")
        assert told or done.stderr == (FULL if "full" in lost else "")

"""What Windows or macOS lack is done without, or named as not supported: never an internal error."""

from __future__ import annotations

import os
import select
from pathlib import Path

import pytest

from firmloop.cli import main
from firmloop.verify.links import semihosting
from firmloop.verify.links.turns import PipeTurns, Processors

QEMU = "qemu_mps2_an386"


@pytest.fixture
def bare(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Take away what only Linux or only Unix has; pytest itself needs it for the folder it gives."""
    for name in ("getuid", "geteuid", "sched_getaffinity", "sched_setaffinity", "pidfd_open"):
        monkeypatch.delattr(os, name, raising=False)
    monkeypatch.delattr(select, "poll", raising=False)
    monkeypatch.setattr(semihosting, "DESCRIPTORS", Path("/no/such/folder"))


@pytest.fixture
def own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Build anew, in a folder for temporary files of the test."""
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))


@pytest.mark.usefixtures("bare", "own_cache")
def test_the_whole_walk_on_the_host_needs_none_of_it(
    project: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["run", str(project), "--out", str(tmp_path / "out"), "--steps", "500"]) == 0
    said = capsys.readouterr()
    assert said.err == "" and "host: " in said.out and ": agrees" in said.out
    assert not (tmp_path / "firmloop").exists(), "beside it python -m firmloop would find no package"


@pytest.mark.usefixtures("bare")
@pytest.mark.parametrize("command", ["targets", "targets --ports", "doctor"])
def test_what_looks_something_up_needs_none_of_it(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(command.split()) in (0, 3)
    assert capsys.readouterr().err == ""


@pytest.mark.cross
@pytest.mark.usefixtures("bare")
@pytest.mark.parametrize("port", [[], ["--port", "pty"], ["--port", "uart"]])
def test_an_emulator_without_it_is_not_supported_here(
    project: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], port: list[str]
) -> None:
    arguments = ["verify", str(project), "--out", str(tmp_path / "out"), "--target", QEMU, "--steps", "500", *port]
    assert main(arguments) == 3
    said = capsys.readouterr()
    assert "not supported here: " in said.err and "internal error" not in said.err


@pytest.mark.qemu
def test_without_proc_another_link_is_named_and_works(
    project: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("sched_getaffinity", "sched_setaffinity", "pidfd_open"):
        monkeypatch.delattr(os, name, raising=False)
    monkeypatch.setattr(semihosting, "DESCRIPTORS", Path("/no/such/folder"))
    arguments = ["verify", str(project), "--out", str(tmp_path / "out"), "--target", QEMU, "--steps", "500"]
    assert main(arguments) == 3
    assert "not supported here: " in (said := capsys.readouterr().err) and "--port pty" in said
    assert main([*arguments, "--port", "pty"]) == 0


@pytest.mark.usefixtures("bare")
def test_processors_that_cannot_be_chosen_are_left_alone() -> None:
    processors = Processors()
    assert not processors.apart()
    processors.together()
    processors.undo()
    reader, writer = os.pipe()
    try:
        turns = PipeTurns(processors, os.getpid(), reader, writer)
        assert not turns.ask() and not turns.set_emulator_blocking(False)
    finally:
        os.close(reader)
        os.close(writer)

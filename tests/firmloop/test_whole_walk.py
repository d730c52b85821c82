"""From recordings to verdict through the front door, and what happens where a target is not there."""

from __future__ import annotations

import json
import math
import os
import re
import shutil
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest

from firmloop.cli import main
from firmloop.codegen.bundle import Bundle
from firmloop.door.run import run
from firmloop.project.project import read_project
from firmloop.stages import making

ROOT = Path(__file__).parents[2]
SCHEMA = json.loads((ROOT / "tests" / "schema" / "verdict.schema.json").read_text())
QEMU = "qemu_mps2_an386"


def _verdict(path: Path) -> dict[str, Any]:
    verdict = json.loads(path.read_text())
    jsonschema.validate(verdict, SCHEMA)
    assert isinstance(verdict, dict)
    return verdict


def _run(arguments: list[str], **environment: str) -> subprocess.CompletedProcess[str]:
    kept = {**os.environ, "PYTHONPATH": str(ROOT), **environment}
    command = [sys.executable, "-m", "firmloop", *arguments]
    return subprocess.run(command, capture_output=True, text=True, env=kept, timeout=600, check=False)


def test_run_on_the_host(project: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    assert main(["run", str(project), "--out", str(out), "--steps", "20000"]) == 0
    said = capsys.readouterr().out
    verdict = _verdict(out / "verdict.json")
    assert verdict["verdict"] == "agrees" and verdict["target"] == "host"
    assert isinstance(verdict["steps"], int) and verdict["steps"] >= 20000
    assert f"host: {verdict['steps']:,} steps, 0 differences: agrees" in said
    assert {path.name for path in out.iterdir()} >= {
        "project.toml",
        "tank_heater",
        "manifest.json",
        "verdict.json",
        "verdict_host.json",
        "report.html",
    }
    assert read_project(out / "project.toml").name == "tank_heater"
    assert (out / "report.html").read_text().count("host: agrees") == 1
    assert not [path for path in tmp_path.rglob(".*")]


def test_run_twice_gives_the_same_bytes(project: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for _ in range(2):
        assert main(["run", str(project), "--out", str(tmp_path / "out"), "--steps", "500", "--json"]) == 0
        files = {path: path.read_bytes() for path in (tmp_path / "out").rglob("*") if path.is_file()}
        (tmp_path / "first").mkdir(exist_ok=True)
        for name, content in files.items():
            kept = tmp_path / "first" / name
            if not kept.exists():
                kept.write_bytes(content)
            assert kept.read_bytes() == content, name
    document = json.loads(capsys.readouterr().out.split("}\n{")[0] + "}")
    assert set(document) == {"schema", "plant", "controller", "code", "verdicts", "written"}


def test_verify_needs_neither_plant_nor_recordings(
    project: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = project.read_text()
    project.write_text(text[: text.index("[recordings]")] + text[text.index("[controller]") :])
    assert main(["verify", str(project), "--out", str(tmp_path / "out"), "--steps", "1000", "--json"]) == 0
    said = capsys.readouterr()
    assert said.err == ""
    (verdict,) = json.loads(said.out)["verdicts"]
    jsonschema.validate(verdict, SCHEMA)


def test_a_difference_ends_in_status_1(
    project: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    sound = making.emit

    def planted(*arguments: Any) -> Bundle:
        """Plant one wrong operation into the C."""
        bundle = sound(*arguments)
        source = bundle.sources[0]
        text, count = re.subn(r"(fl_mac_i64\(\w+, \S+, )-", r"\1", bundle.files[source], count=1)
        assert count == 1
        return replace(bundle, files={**bundle.files, source: text})

    project.write_text(project.read_text().replace('number = "float32"', 'number = "fixed"'))
    monkeypatch.setattr(making, "emit", planted)
    assert main(["verify", str(project), "--out", str(tmp_path / "out"), "--steps", "2000"]) == 1
    said = capsys.readouterr()
    assert "host: " in said.out and "DIFFERS" in said.out and "expected" in said.out
    verdict = _verdict(tmp_path / "out" / "verdict.json")
    assert verdict["verdict"] == "differs" and verdict["first_difference"]


def test_a_missing_qemu_leaves_the_host_half(project: Path, tmp_path: Path, built: Path) -> None:
    """Only the tools of the host half are on PATH; no other test has built this controller in that cache."""
    tools = tmp_path / "tools"
    tools.mkdir()
    for name in ("gcc", "as", "ld", "ar", "nm", "size", "objdump"):
        found = shutil.which(name)
        if found:
            (tools / name).symlink_to(found)
    project.write_text(project.read_text().replace('["host"]', f'["{QEMU}", "host"]'))
    out = tmp_path / "out"
    arguments = ["run", str(project), "--out", str(out), "--steps", "1000"]
    done = _run(arguments, PATH=str(tools), XDG_CACHE_HOME=str(built))
    assert done.returncode == 3, done.stderr
    (message,) = [line for line in done.stderr.splitlines() if line.startswith("firmloop: ")]
    assert QEMU in message and "apt-get install" in message
    assert f"{QEMU}: NOT RUN" in done.stdout and "host: " in done.stdout
    assert _verdict(out / "verdict.json")["target"] == "host"
    assert not (out / f"verdict_{QEMU}.json").exists()
    assert f"{QEMU}: not run" in (out / "report.html").read_text()
    # verify alone of that target has nothing to show.
    arguments = ["verify", str(project), "--out", str(tmp_path / "none"), "--target", QEMU, "--steps", "1000"]
    done = _run(arguments, PATH=str(tools), XDG_CACHE_HOME=str(built))
    (message,) = [line for line in done.stderr.splitlines() if " after " not in line]  # without progress
    assert done.returncode == 3 and message.startswith("firmloop: ")
    assert "apt-get install" in message and not (tmp_path / "none").exists()


@pytest.fixture
def flaky_port() -> Iterator[str]:
    """A port that takes a few bytes and goes away, again and again."""
    server = socket.create_server(("127.0.0.1", 0))

    def serve() -> None:
        while True:
            try:
                line, _ = server.accept()
            except OSError:
                return
            line.recv(8)
            line.close()

    thread = threading.Thread(target=serve, daemon=True)
    thread.start()
    yield f"socket://127.0.0.1:{server.getsockname()[1]}"
    server.shutdown(socket.SHUT_RDWR)
    server.close()
    thread.join(5)


@pytest.mark.cross
def test_a_port_that_goes_away(
    flaky_port: str, project: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["verify", str(project), "--out", str(tmp_path / "out"), "--target", QEMU, "--port", flaky_port]
    assert main(arguments) == 3
    said = capsys.readouterr().err
    (message,) = [line for line in said.splitlines() if line.startswith("firmloop: ")]
    assert flaky_port in message
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("port", ["/dev/no_such_port", "socket://127.0.0.1:1", "nonsense://x", ""])
@pytest.mark.cross
def test_a_port_that_is_not_there(port: str, project: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["verify", str(project), "--out", str(tmp_path / "out"), "--target", QEMU, "--port", port]
    assert main(arguments) == 3
    assert len(capsys.readouterr().err.splitlines()) == 1
    assert not (tmp_path / "out").exists()


@pytest.mark.qemu
def test_run_on_the_cortex_m(project: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    project.write_text(project.read_text().replace('["host"]', f'["host", "{QEMU}"]'))
    out = tmp_path / "out"
    assert main(["run", str(project), "--out", str(out), "--steps", "5000"]) == 0
    verdict = _verdict(out / "verdict.json")
    assert verdict["target"] == QEMU and verdict["cost"]["instructions_max"] > 10
    assert "instructions per step" in capsys.readouterr().out
    assert "agrees" in (out / "report.html").read_text()


@pytest.mark.qemu
def test_the_loop_of_a_run_is_closed_with_the_fitted_plant(project: Path) -> None:
    """The file says gain 1 and 1 s, the recordings say 3 and 2 s."""
    project.write_text(project.read_text().replace('["host"]', f'["{QEMU}"]'))
    walked = run(read_project(project), steps=500)
    loop = walked.verified.verdicts[QEMU].closed_loop
    assert loop is not None and loop.differences == 0
    command, measured = np.array(loop.command), np.array(loop.measurement)
    values = {each.name: each.value for each in walked.identified.plant.parameters}
    share = 1.0 - math.exp(-0.05 / values["time_constant_s"])
    follows = measured[:-1] + share * (values["gain"] * command[:-1] - measured[:-1])
    assert abs(values["gain"] - 3.0) < 0.1
    assert np.allclose(measured[1:], follows, atol=0.01 * np.ptp(measured))

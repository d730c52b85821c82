"""A predictive controller that is told ahead, through the command line: bit for bit, and closer to what is wanted."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from firmloop.cli import main

PROJECT = """\
schema = 1
name = "servo"
[controller]
kind = "mpc"
period_s = 0.01
horizon = 6
preview = 6
disturbances = ["load"]
E = [[-0.002908], [-0.57663]]
A = [[1.0, 0.009612], [0.0, 0.923116]]
B = [[0.002908], [0.57663]]
Q = [200.0, 0.1]
R = 0.01
[signals]
reference = { unit = "rad", low = -2, high = 2 }
load = { unit = "V", low = -3, high = 3 }
angle = { unit = "rad", low = -2, high = 2 }
speed = { unit = "rad/s", low = -30, high = 30 }
output = { unit = "V", low = -6, high = 6 }
[arithmetic]
number = "float32"
[target]
names = ["host", "qemu_mps2_an386"]
"""


@pytest.mark.qemu
def test_what_is_known_ahead_waits_in_the_controller(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, out = tmp_path / "servo.toml", tmp_path / "out"
    path.write_text(PROJECT)
    assert main(["verify", str(path), "--out", str(out), "--steps", "100"]) == 0
    said = capsys.readouterr().out
    assert "search: cut short at a work of " in said and "instructions with the whole budget taken" in said
    for name in ("host", "qemu_mps2_an386"):
        verdict = json.loads((out / f"verdict_{name}.json").read_text())
        assert (verdict["verdict"], verdict["differences"]) == ("agrees", 0)
    manifest = json.loads((out / "manifest.json").read_text())
    assert [entry["name"] for entry in manifest["inputs"]] == ["reference", "load", "angle", "speed"]
    assert {f"{name}_in_{k}" for name in ("reference", "load") for k in range(6)} <= {
        entry["name"] for entry in manifest["state"]
    }
    assert "limit" in (out / "search_qemu_mps2_an386.svg").read_text() and not (out / "search_host.svg").exists()
    search = verdict["search"]
    assert 0 < search["work_max"] <= search["budget"] + 14, "a column, and a row of each move, may come after"
    assert verdict["cost"]["instructions_max"] <= search["instructions_bound"]

"""The examples of nonlinear predictive control through the command line: C, bits, and the loop closed by the C."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from firmloop.cli import main

EXAMPLES = Path(__file__).parents[2] / "examples"
CHIP = "qemu_mps2_an386"


def verified(path: Path, out: Path) -> dict[str, Any]:
    """Verify a project on the host and the emulated chip and return the chip's verdict."""
    assert main(["verify", str(path), "--out", str(out), "--steps", "40"]) == 0
    host = json.loads((out / "verdict_host.json").read_text())
    assert (host["verdict"], host["differences"]) == ("agrees", 0) and host["steps"] >= 40
    verdict: dict[str, Any] = json.loads((out / f"verdict_{CHIP}.json").read_text())
    return verdict


@pytest.mark.qemu
def test_the_motor_on_a_short_horizon_agrees_on_host_and_chip_also_in_closed_loop(tmp_path: Path) -> None:
    text = (EXAMPLES / "motor_nmpc" / "motor_nmpc.toml").read_text()
    assert text.count("horizon = 10") == 1
    path, out = tmp_path / "motor.toml", tmp_path / "out"
    path.write_text(text.replace("horizon = 10", "horizon = 2"))
    verdict = verified(path, out)
    assert (verdict["verdict"], verdict["differences"]) == ("agrees", 0)
    assert verdict["closed_loop"] == {"steps": 1000, "differences": 0}
    manifest = json.loads((out / "manifest.json").read_text())
    assert [each["name"] for each in manifest["inputs"]] == ["reference", "speed", "measurement"]
    source = "".join((out / name).read_text() for name in manifest["sources"])
    assert "malloc" not in source and "double" not in source


@pytest.mark.slow
@pytest.mark.qemu
@pytest.mark.parametrize("name", ["pendulum_nmpc", "motor_nmpc"])
def test_an_example_agrees_and_a_step_takes_what_a_microcontroller_has(name: str, tmp_path: Path) -> None:
    verdict = verified(EXAMPLES / name / f"{name}.toml", tmp_path)
    assert (verdict["verdict"], verdict["differences"]) == ("agrees", 0)
    assert verdict["closed_loop"]["steps"] > 0 and verdict["closed_loop"]["differences"] == 0
    assert 0 < verdict["cost"]["instructions_max"] <= 150_000

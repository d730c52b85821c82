"""The examples of nonlinear predictive control through the command line: C, bits, and the loop closed by the C."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from firmloop.cli import main

EXAMPLES = Path(__file__).parents[2] / "examples"


def verified(name: str, target: str, out: Path) -> dict[str, Any]:
    """Verify an example on one target and return its verdict."""
    path = EXAMPLES / name / f"{name}.toml"
    assert main(["verify", str(path), "--out", str(out), "--steps", "60", "--target", target]) == 0
    verdict: dict[str, Any] = json.loads((out / "verdict.json").read_text())
    return verdict


def test_the_generated_c_has_no_heap_and_no_double(tmp_path: Path) -> None:
    path = EXAMPLES / "motor_nmpc" / "motor_nmpc.toml"
    assert main(["generate", str(path), "--out", str(tmp_path)]) == 0
    manifest = json.loads((tmp_path / "manifest.json").read_text())
    assert [each["name"] for each in manifest["inputs"]] == ["reference", "speed", "measurement"]
    text = "".join((tmp_path / name).read_text() for name in (*manifest["sources"], *manifest["headers"]))
    assert "malloc" not in text and "double" not in text and "coulomb" not in text


@pytest.mark.parametrize("name", ["pendulum_nmpc", "motor_nmpc"])
def test_an_example_agrees_on_the_host(name: str, tmp_path: Path) -> None:
    verdict = verified(name, "host", tmp_path)
    assert (verdict["verdict"], verdict["differences"]) == ("agrees", 0) and verdict["steps"] >= 60


@pytest.mark.qemu
def test_the_motor_agrees_on_the_chip_and_holds_its_weight(tmp_path: Path) -> None:
    verdict = verified("motor_nmpc", "qemu_mps2_an386", tmp_path)
    assert (verdict["verdict"], verdict["differences"]) == ("agrees", 0)
    assert 0 < verdict["cost"]["instructions_max"] <= 150_000

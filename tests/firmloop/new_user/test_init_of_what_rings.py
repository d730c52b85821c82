"""`firmloop init` on a plant that rings, for which no rule tunes: it keeps its kind, and gets an integral alone."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path

import numpy as np
import pytest
import scipy

from firmloop.cli import main

GAIN, FREQUENCY = 1.2, 30.0  # -, rad/s


def answered(pushes: np.ndarray, step: float, damping: float) -> np.ndarray:
    """Return what a second-order plant answers, exactly, to inputs that are held from row to row."""
    a = np.array([[0.0, 1.0], [-(FREQUENCY**2), -2.0 * damping * FREQUENCY]])
    b, c = np.array([[0.0], [GAIN * FREQUENCY**2]]), np.array([[1.0, 0.0]])
    return scipy.signal.dlsim(scipy.signal.cont2discrete((a, b, c, [[0.0]]), step), pushes)[1][:, 0]


@pytest.mark.parametrize(
    ("header", "damping"), [("t (s),Vin (V),Vout (V)", 0.05), ("time_s,duty,vout_V", 0.15), ("t,u,vout", 0.45)]
)
def test_a_plant_that_rings_is_no_lag_and_its_loop_leaves_the_resonance_in_peace(
    header: str, damping: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    dice = np.random.default_rng(4)
    pushes = np.repeat(dice.integers(0, 2, 40) * 5.0, 15)
    read = answered(pushes, 0.01, damping) + dice.normal(0.0, 0.01, len(pushes))
    rows = [f"{0.01 * k:.2f},{u:.1f},{y:.4f}" for k, (u, y) in enumerate(zip(pushes, read, strict=True))]
    Path("ring.csv").write_text("\n".join([header, *rows, ""]))
    assert main(["init", "ring.csv"]) == 0, capsys.readouterr().err
    made = tomllib.loads(Path("ring.toml").read_text())
    values = {name: each["value"] for name, each in made["plant"]["parameters"].items()}
    assert made["plant"]["kind"] == "second_order"
    assert values["natural_frequency_rad_s"] == pytest.approx(FREQUENCY, rel=0.01)
    assert values["damping_ratio"] == pytest.approx(damping, rel=0.05)
    assert values["gain"] == pytest.approx(GAIN, rel=0.02)
    assert made["controller"]["kp"] == 0.0 and "tune" not in made["controller"]
    capsys.readouterr()
    assert main(["design", "ring.toml", "--out", "out", "--json"]) == 0
    margins = json.loads(capsys.readouterr().out)["controller"]["margins"]
    assert margins["gain_margin_db"] > 9.0 and margins["sensitivity_peak"] < 1.6

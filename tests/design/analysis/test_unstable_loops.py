"""Of an unstable loop design tells which gain makes it stable, and no margin to a crossing behind which it is not."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from firmloop.cli import main

PERIOD = 0.01
PROJECT = """\
schema = 1
name = "loop"
[plant]
kind = "first_order"
input = "u_V"
outputs = ["y_V"]
[plant.parameters]
gain = {{ value = {gain}, free = false }}
time_constant_s = {{ value = {lag}, free = false }}
delay_s = {{ value = {delay}, free = false }}
[controller]
kind = "pid"
period_s = 0.01
kp = {kp}
ki = {ki}
[signals]
reference = {{ unit = "V", low = -5, high = 5 }}
measurement = {{ unit = "V", low = -10, high = 10 }}
output = {{ unit = "V", low = -10, high = 10 }}
[arithmetic]
number = "float32"
[target]
names = ["host"]
"""


def stable(gain: float, lag: float, delay: float, kp: float, ki: float) -> bool:
    """Tell it by the poles of y+ = a y + (1-a) gain u[k-n], u = -kp y + I, I+ = I - ki h y."""
    late = round(delay / PERIOD)
    kept = np.exp(-PERIOD / lag)
    ring = np.zeros((late + 2, late + 2))
    ring[0, 0], ring[0, 1 + late] = kept, gain * (1 - kept)
    ring[1, 1], ring[1, 0] = 1.0, -ki * PERIOD
    ring[2, :2] = -kp, 1.0
    for k in range(1, late):
        ring[2 + k, 1 + k] = 1.0
    return bool(np.max(np.abs(np.linalg.eigvals(ring))) < 1.0)


def said(tmp_path: Path, capsys: pytest.CaptureFixture[str], **values: float) -> str:
    path = tmp_path / "loop.toml"
    path.write_text(PROJECT.format(**values))
    assert main(["design", str(path), "--out", str(tmp_path / "out")]) == 0
    return capsys.readouterr().out


@pytest.mark.parametrize(
    ("lag", "delay", "kp", "ki"), [(1.0, 0.2, 20.0, 1.0), (0.5, 0.1, 1.0, 500.0), (1.9, 0.3, 25.0, 718.0)]
)
def test_the_gain_that_makes_it_stable_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], lag: float, delay: float, kp: float, ki: float
) -> None:
    """The nearest crossing of the second and the third is at a greater gain, where two more poles leave the circle."""
    told = re.search(
        r"stable with its gain below (\S+) times", said(tmp_path, capsys, gain=1.0, lag=lag, delay=delay, kp=kp, ki=ki)
    )
    assert told
    edge = float(told.group(1))
    assert stable(1.0, lag, delay, 0.98 * edge * kp, 0.98 * edge * ki)
    assert not any(stable(1.0, lag, delay, g * kp, g * ki) for g in np.geomspace(1.02 * edge, 1.0, 50))


@pytest.mark.parametrize(("kp", "advice"), [(1.0, "the other sign does"), (60.0, "change the ratio of its terms")])
def test_a_loop_that_no_smaller_or_greater_gain_makes_stable_has_no_margin(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], kp: float, advice: str
) -> None:
    text = said(tmp_path, capsys, gain=-1.0, lag=1.0, delay=0.1, kp=kp, ki=1.0)
    assert "UNSTABLE" in text and advice in text
    assert re.search(r"gain margin +none", text)
    assert stable(-1.0, 1.0, 0.1, -kp, -1.0) == (kp == 1.0)

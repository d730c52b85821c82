"""The whole walk on real bench recordings, which stay outside this repository."""

import json
from pathlib import Path

import pytest

from firmloop.cli import main

BALL_AND_HOOP = """
schema = 1
name = "hoop_motor"

[recordings]
train = ["{folder}/ball_and_hoop_dc_motor/randomStepSequence.csv"]
test = ["{folder}/ball_and_hoop_dc_motor/fixedStepSequence.csv"]

[plant]
kind = "first_order"
input = "motor_cmd_norm"
outputs = ["tacho_V"]

[controller]
kind = "pid"
period_s = 0.1
tune = "simc"
tau_c_s = 0.4

[signals]
reference = {{ unit = "V", low = -10, high = 10 }}
measurement = {{ unit = "V", low = -11, high = 11 }}
output = {{ unit = "norm", low = -1, high = 1 }}

[arithmetic]
number = "fixed"
bits = 16

[target]
names = ["host", "qemu_mps2_an386"]
"""

EMPS = """
schema = 1
name = "stage_position"

[recordings]
train = ["{folder}/emps/train.csv.gz"]
test = ["{folder}/emps/test_pulses.csv.gz"]
[recordings.conditioning]
window_s = 0.5

[plant]
kind = "linear_stage"
input = "force_N"
outputs = ["position_m"]
[plant.parameters]
mass_kg = 90.0
b_N_s_m = 200.0

[controller]
kind = "pid"
period_s = 0.001
tune = "simc"
tau_c_s = 0.02

[signals]
reference = {{ unit = "m", low = -0.3, high = 0.3 }}
measurement = {{ unit = "m", low = -0.3, high = 0.3 }}
output = {{ unit = "N", low = -350, high = 350 }}

[arithmetic]
number = "float32"

[target]
names = ["host", "qemu_mps2_an386"]
"""


@pytest.mark.recordings
@pytest.mark.qemu
@pytest.mark.parametrize(
    "text",
    [pytest.param(BALL_AND_HOOP, id="ball_and_hoop"), pytest.param(EMPS, id="emps", marks=pytest.mark.slow)],
)
def test_walk_on_host_and_cortex_m(text: str, recordings: Path, tmp_path: Path) -> None:
    project = tmp_path / "project.toml"
    project.write_text(text.format(folder=recordings.resolve().as_posix()))
    assert main(["run", str(project), "--out", str(tmp_path / "out"), "--steps", "30000"]) == 0
    for file, target in (("verdict_host", "host"), ("verdict_qemu_mps2_an386", "qemu_mps2_an386")):
        verdict = json.loads((tmp_path / "out" / f"{file}.json").read_text())
        assert (verdict["verdict"], verdict["differences"], verdict["target"]) == ("agrees", 0, target)
        assert verdict["steps"] > 30_000  # the recorded signals are played on top
    assert verdict["cost"]["instructions_max"] > 0

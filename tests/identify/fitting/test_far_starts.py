"""What an output is linear in, a gain and a level, is found from any start, and a fit that failed blames no log."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import numpy as np
import pytest

from firmloop.cli import main
from firmloop.identify.fitting.checks.early import early_outputs
from firmloop.identify.fitting.evidence import Evidence
from firmloop.identify.fitting.fit import estimate
from firmloop.identify.plants.kinds import make_plant
from firmloop.identify.recordings.conditioning import NONE
from firmloop.identify.recordings.recording import make_recording

ROWS, STEP, LAG = 1500, 0.01, 0.5
DRIVE = np.repeat(np.random.default_rng(0).choice([-3.0, -1.0, 0.0, 2.0, 4.0], ROWS // 50), 50)
TIME = np.arange(ROWS) * STEP
KINDS = {
    "first_order": "time_constant_s = 1.0",
    "second_order": "natural_frequency_rad_s = 4.0\ndamping_ratio = { value = 1.0, free = false }",
    "process": "time_constant_s = 1.0\n"
    + "".join(
        f"{name} = {{ value = 0, free = false }}\n" for name in ("second_time_constant_s", "zero_time_constant_s")
    ),
    "static": "",
}


def answered(kind: str) -> np.ndarray:
    """The answer of gain 2 with noise of 1 %."""
    out = np.zeros(ROWS)
    state = np.zeros(2)
    keep = np.exp(-STEP / LAG)
    for row in range(ROWS - 1):  # a second lag of the same time constant is a damping ratio of 1 at 1 / LAG
        held = 2.0 * DRIVE[row]
        if kind == "second_order":
            away, slope = state[0] - held, state[1]
            turn = slope + away / LAG
            state = np.array([held + (away + turn * STEP) * keep, (slope - turn * STEP / LAG) * keep])
        else:
            state = np.array([held + (state[0] - held) * keep, 0.0])
        out[row + 1] = state[0]
    if kind == "static":
        out[1:] = 2.0 * DRIVE[:-1]  # a row is read just before its input acts
    return out + np.random.default_rng(1).normal(0.0, 0.02, ROWS)


def identified(folder: Path, kind: str, starts: str, drive: np.ndarray, output: np.ndarray, more: str = "") -> int:
    rows = "\n".join(f"{t:.4f},{u:.6g},{y:.9g}" for t, u, y in zip(TIME, drive, output, strict=True))
    (folder / "r.csv").write_text(f"time_s,voltage_V,temperature_C\n{rows}\n")
    (folder / "p.toml").write_text(
        f'schema = 1\nname = "a"\n[recordings]\ntrain = ["r.csv"]\n{more}\n[plant]\nkind = "{kind}"\n'
        f'input = "voltage_V"\noutputs = ["temperature_C"]\n[plant.parameters]\n{starts}\n'
    )
    return main(["identify", str(folder / "p.toml"), "--out", str(folder / "out")])


def found(folder: Path) -> dict[str, float]:
    table = tomllib.loads((folder / "out" / "project.toml").read_text())["plant"]["parameters"]
    return {name: entry["value"] for name, entry in table.items()}


@pytest.mark.parametrize("kind", list(KINDS))
@pytest.mark.parametrize("times", [1e5, -1e3, 400.0, 1e-5])
def test_a_gain_is_found_from_any_start(
    kind: str, times: float, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    delay = "" if kind == "static" else "delay_s = { value = 0.0, free = false }\n"
    status = identified(tmp_path, kind, f"gain = 1.0\n{KINDS[kind]}\n{delay}", DRIVE, times * answered(kind))
    said = capsys.readouterr()
    assert status == 0, said.err
    values = found(tmp_path)
    assert values["gain"] == pytest.approx(2.0 * times, rel=5e-3)
    if "time_constant_s" in values:
        assert values["time_constant_s"] == pytest.approx(LAG, rel=5e-3)
    assert "no plant can" not in said.out


@pytest.mark.parametrize(
    "more", ["", 'hold = "linear"', '[recordings.conditioning]\nalign = ["temperature_C"]\nalign_max_lag_s = 0.2']
)
@pytest.mark.parametrize("delay", ["", "delay_s = { value = 0.0, free = false }"])
def test_neither_a_hold_nor_a_missing_delay_nor_a_clock_changes_that(more: str, delay: str, tmp_path: Path) -> None:
    starts = f"gain = 1.0\ntime_constant_s = 1.0\n{delay}"
    assert identified(tmp_path, "first_order", starts, DRIVE, 1e3 * answered("first_order"), more) == 0
    assert found(tmp_path)["gain"] == pytest.approx(2e3, rel=2e-2)


@pytest.mark.parametrize(("kind", "level"), [("first_order", "output_at_rest"), ("static", "offset")])
def test_a_level_is_found_from_any_start(kind: str, level: str, tmp_path: Path) -> None:
    starts = f"gain = 1.0\n{KINDS[kind]}\n{level} = {{ value = 1.0, free = true }}"
    assert identified(tmp_path, kind, starts, DRIVE, answered(kind) + 3e4) == 0
    values = found(tmp_path)
    assert values["gain"] == pytest.approx(2.0, rel=5e-3)
    assert values[level] == pytest.approx(3e4, rel=1e-5)


def test_a_fit_that_had_not_come_to_its_end_is_no_shifted_column() -> None:
    columns = {"voltage_V": DRIVE, "temperature_C": 1e3 * answered("first_order")}
    seen = make_recording(TIME, columns, "r.csv", "")
    starts = {"gain": 1.0, "time_constant_s": 1.0}
    plant = make_plant("first_order", "voltage_V", ["temperature_C"], {**starts, "delay_s": 0.0})
    poor = estimate(plant, [seen], (), NONE, near=True)  # values that are told to be near, and are not
    assert poor.noise["temperature_C"] > 1e3
    assert early_outputs(Evidence(plant, (seen,), NONE, poor), poor.noise) == ""


def test_an_input_that_stands_still_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    starts = "gain = 1.0\ntime_constant_s = 1.0"
    assert identified(tmp_path, "first_order", starts, np.full(ROWS, 2.0), answered("first_order")) == 2
    said = capsys.readouterr().err
    assert "r.csv: voltage_V is 2 in every row, so that gain cannot be told" in said
    assert "wiring" not in said and "another kind" not in said


def test_a_ramp_that_tells_no_gain_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A motor that gives up at the top of its one ramp answers: the wiring is not at fault."""
    ramp = np.linspace(0.0, 10.0, ROWS)
    thrust = np.where(ramp < 8.0, ramp, 8.0 - 4.0 * (ramp - 8.0)) + np.random.default_rng(0).normal(0.0, 0.01, ROWS)
    assert identified(tmp_path, "static", "gain = { value = 1.0, free = true }", ramp, thrust) == 2
    said = capsys.readouterr().err
    assert "voltage_V only rises" in said and "record it going up and down" in said and "wiring" not in said


@pytest.mark.parametrize("start", ["delay_s = 0.7", "time_constant_s = 1e9", "time_constant_s = 1e-5\ngain = 2.0"])
def test_a_start_value_that_leads_astray_is_left_and_blames_no_log(tmp_path: Path, start: str) -> None:
    assert identified(tmp_path, "first_order", start, DRIVE, answered("first_order")) == 0
    with (tmp_path / "out" / "project.toml").open("rb") as file:
        found = tomllib.load(file)["plant"]["parameters"]
    assert found["gain"]["value"] == pytest.approx(2.0, rel=0.01)
    assert found["time_constant_s"]["value"] == pytest.approx(LAG, rel=0.01)


@pytest.mark.parametrize("delay", [0.7, 6.0])
def test_a_delay_that_is_kept_and_denied_is_told_however_far_off_it_is(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], delay: float
) -> None:
    kept = f"delay_s = {{ value = {delay}, free = false }}"
    assert identified(tmp_path, "first_order", kept, DRIVE, answered("first_order")) == 0
    asked = re.search(r"asks for delay_s = (\S+) in place of (\S+) s", capsys.readouterr().out)
    assert asked and float(asked[1]) < 0.001 and float(asked[2]) == delay


def test_numbers_too_large_or_too_small_to_compute_with_are_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output = answered("first_order")
    assert identified(tmp_path, "first_order", "input_at_rest = 9e15", DRIVE, output) == 2
    assert "a value in [plant.parameters] is far too large" in capsys.readouterr().err
    assert identified(tmp_path, "first_order", "", DRIVE, output * 1e-320) == 2
    assert "r.csv: column temperature_C: holds nothing larger than" in capsys.readouterr().err

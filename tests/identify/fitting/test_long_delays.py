"""A delay of many changes of the input is found, and one that no recording holds is refused as such."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from firmloop.cli import main
from tests.diagnose.cases import black_box_project, logged

Array = NDArray[np.float64]

STEP, ROWS = 0.1, 1200
TIME = STEP * np.arange(ROWS)


def project(where: Path, kind: str, drive: Array, answer: Array, given: str = "") -> Path:
    """Write a recording and a project of it."""
    text = black_box_project(kind, "heater", "oven") + f"[plant.parameters]\n{given}"
    return logged(where, text, "time_s,heater,oven", TIME, drive, answer)


def late(seconds: float, seed: int) -> tuple[Array, Array]:
    """Return an input that changes every 3 s, and what 40 in 5 s makes of it so many seconds later, with noise."""
    random = np.random.default_rng(seed)
    drive = np.repeat(random.uniform(0.0, 1.0, ROWS // 30), 30)
    state, answer = 0.0, np.empty(ROWS)
    for k, each in enumerate(np.r_[np.zeros(round(seconds / STEP)), drive][:ROWS]):
        answer[k] = state
        state += (1.0 - np.exp(-STEP / 5.0)) * (40.0 * each - state)
    return drive, answer + 0.5 * random.normal(size=ROWS)


@pytest.mark.parametrize(("kind", "seconds"), [("first_order", 60.0), ("second_order", 45.0), ("process", 75.0)])
def test_a_delay_of_many_changes_of_the_input_is_found(
    kind: str, seconds: float, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    made = project(tmp_path, kind, *late(seconds, 5))
    assert main(["identify", str(made), "--out", str(tmp_path / "out")]) == 0, capsys.readouterr().err
    written = (tmp_path / "out" / "project.toml").read_text()
    assert float(written.split("delay_s = { value = ")[1].split(",")[0]) == pytest.approx(seconds, abs=0.3)
    assert float(written.split("gain = { value = ")[1].split(",")[0]) == pytest.approx(40.0, rel=0.01)


@pytest.mark.parametrize("given", ["delay_s = 1e9\n", "delay_s = { value = 121, free = false }\n"])
def test_a_delay_that_no_recording_holds_is_refused_by_its_name(
    given: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    made = project(tmp_path, "first_order", *late(3.0, 6), given)
    assert main(["identify", str(made), "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    assert "delay_s is given as" in said and "the recording lasts 119.9 s" in said and "rests at" not in said


@pytest.mark.parametrize("level", [0.0, 20.0])
def test_an_output_that_shows_nothing_but_noise_is_not_asked_to_go_up_and_down(
    level: float, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    random = np.random.default_rng(1)
    made = project(tmp_path, "first_order", np.where(TIME > 5.0, 1.0, 0.0), level + 0.1 * random.normal(size=ROWS))
    assert main(["identify", str(made), "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    assert "oven shows nothing but noise while heater changes" in said and "drift" not in said


def test_a_loop_around_a_delay_beyond_all_periods_is_refused_for_the_delay(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    made = tmp_path / "p.toml"
    made.write_text(
        'schema = 1\nname = "oven"\n[plant]\nkind = "first_order"\ninput = "heater"\noutputs = ["oven"]\n'
        "[plant.parameters]\ngain = 2\ntime_constant_s = 10\ndelay_s = 1e9\n"
        '[controller]\nkind = "pid"\nperiod_s = 0.1\ntune = "simc"\n[signals]\n'
        'reference = { unit = "degC", low = 0, high = 100 }\nmeasurement = { unit = "degC", low = 0, high = 100 }\n'
        'output = { unit = "1", low = 0, high = 1 }\n[arithmetic]\nnumber = "float64"\n'
    )
    assert main(["design", str(made), "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    assert "the plant's delay of 1e+09 s" in said and "lower its gains" not in said

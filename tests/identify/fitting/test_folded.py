"""An output that never minds the sign of its input is told as such, and is no broken wire."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from firmloop.cli import main
from tests.diagnose.cases import black_box_project, logged

Array = NDArray[np.float64]

STEP, ROWS = 0.002, 1500
RANDOM = np.random.default_rng(3)
DRIVE = np.repeat(RANDOM.uniform(-1.0, 1.0, 30), ROWS // 30)
TIME = STEP * np.arange(ROWS)


def lagged(drive: Array) -> Array:
    """Answer as 3 in 0.05 s does."""
    state, answer = 0.0, np.empty(ROWS)
    for k, each in enumerate(drive):
        answer[k] = state
        state += (1.0 - np.exp(-STEP / 0.05)) * (3.0 * each - state)
    return answer


def project(where: Path, kind: str, answer: Array, extra: str = "") -> Path:
    """Write a recording and a project of it."""
    noisy = answer + 0.02 * RANDOM.normal(size=ROWS)
    text = black_box_project(kind, "command", "force_N") + extra
    return logged(where, text, "time_s,command,force_N", TIME, DRIVE, noisy)


def identified(made: Path, capsys: pytest.CaptureFixture[str]) -> tuple[int, str]:
    """Return the exit status, and all that is said."""
    status = main(["identify", str(made), "--out", str(made.parent / "out")])
    return status, "".join(capsys.readouterr())


@pytest.mark.parametrize(
    ("kind", "answer", "driven"),
    [
        ("static", 2.0 * np.r_[0.0, DRIVE[:-1]] ** 2, "command^2"),
        ("first_order", lagged(np.abs(DRIVE)), "abs(command)"),
        ("second_order", lagged(np.abs(DRIVE)), "abs(command)"),
        ("first_order", lagged(DRIVE**2), "command^2"),
    ],
)
def test_an_answer_to_the_size_of_the_input_is_told_with_the_column_to_write(
    kind: str, answer: Array, driven: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    _, said = identified(project(tmp_path, kind, answer), capsys)
    assert "answers the size of command, not its sign" in said and f"driven by {driven}" in said
    assert "wiring" not in said and "drift" not in said


@pytest.mark.parametrize(("kind", "answer"), [("static", 3.0 * np.r_[0.0, DRIVE[:-1]]), ("first_order", lagged(DRIVE))])
def test_a_reading_without_its_sign_is_told_with_lines_that_fit_it(
    kind: str, answer: Array, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    _, said = identified(project(tmp_path, kind, np.abs(answer)), capsys)
    assert "without a sign" in said and "wiring" not in said and "drift" not in said
    values = said.split("[plant.parameters] ")[1].split("; or record")[0].replace("}, ", "}\n")
    effect = '[[plant.effects]]\nname = "sensor_rectified"\noutput = "force_N"\nshare = 1\n'
    status, again = identified(
        project(tmp_path, kind, np.abs(answer), f"[plant.parameters]\n{values}\n{effect}"), capsys
    )
    assert status == 0 and "without a sign" not in again
    written = (tmp_path / "out" / "project.toml").read_text()
    gain = float(written.split("gain = { value = ")[1].split(",")[0])
    assert gain == pytest.approx(3.0, rel=0.01)


def test_an_answer_that_nothing_explains_is_not_called_a_broken_wire(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """It swings by itself, and slowly: neither is the wire to blame, nor is it a drift of the output."""
    swing = np.sin(3.0 * TIME + 0.4 * np.sin(7.0 * TIME)) * 2.0
    status, said = identified(project(tmp_path, "first_order", swing), capsys)
    assert status == 0 or ("explains only" in said and "something else moves it" in said)
    assert "wiring" not in said and "detrend" not in said


def test_the_speed_of_an_arm_in_gravity_answers_its_torque_though_it_comes_to_rest(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Gravity holds the arm, so that its speed has no gain at rest: it answers all the same."""
    angle = speed = 0.0
    answer = np.empty(ROWS)
    for k, each in enumerate(DRIVE):
        answer[k] = speed
        for _ in range(20):
            speed += STEP / 20.0 * (0.5 * each - 0.02 * speed - np.sin(angle)) / 0.01
            angle += STEP / 20.0 * speed
    status, said = identified(project(tmp_path, "process", answer), capsys)
    assert status == 0 or "explains only" in said
    assert "wiring" not in said and "does not answer" not in said

"""A plant that several inputs drive is judged by all of them, in whatever order the project names them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from firmloop.cli import main

ROWS, STEP, FINE = 1500, 1.0, 10  # rows, s, steps of the integration within a row
PROJECT = """
schema = 1
name = "oven"
[recordings]
train = ["log.csv"]
[plant]
kind = "ode"
states = ["t1_C", "t2_C"]
inputs = [{inputs}]
[plant.outputs]
temperature_C = "t2_C"
[plant.derivatives]
t1_C = "(heat_W - g12_W_K*(t1_C - t2_C))/c1_J_K"
t2_C = "(g12_W_K*(t1_C - t2_C) - g_W_K*(t2_C - ambient_C))/c2_J_K"
[plant.parameters]
g12_W_K = {{ value = 1.8, free = true }}
g_W_K = {{ value = 0.7, free = true }}
c1_J_K = {{ value = 22, free = true }}
c2_J_K = {{ value = 10, free = true }}
"""


def said(folder: Path, capsys: pytest.CaptureFixture[str], inputs: str, bend: float) -> str:
    """Identify an oven whose Peltier element gives u + bend u |u|, in a room that swings as one sine."""
    random = np.random.default_rng(3)
    time = np.arange(ROWS) * STEP
    room = 20.0 + 5.0 * np.sin(2.0 * np.pi * 20.0 * time / ROWS)
    heat = np.repeat(random.choice([-40.0, -15.0, 15.0, 40.0], ROWS // 50), 50)
    inner = outer = 20.0
    shown = np.empty(ROWS)
    for k in range(ROWS):
        shown[k] = outer
        for _ in range(FINE):
            into = 2.0 * (inner - outer)
            inner += STEP / FINE * (heat[k] + bend * heat[k] * abs(heat[k]) - into) / 20.0
            outer += STEP / FINE * (into - 0.8 * (outer - room[k])) / 12.0
    shown += 0.05 * random.normal(size=ROWS)
    rows = [f"{t:g},{a:.4f},{u:g},{y:.4f}" for t, a, u, y in zip(time, room, heat, shown, strict=True)]
    (folder / "log.csv").write_text("\n".join(["time_s,ambient_C,heat_W,temperature_C", *rows, ""]))
    (folder / "oven.toml").write_text(PROJECT.format(inputs=inputs))
    assert main(["identify", str(folder / "oven.toml"), "--out", str(folder / "fit")]) == 0
    return capsys.readouterr().out


@pytest.mark.parametrize("inputs", ['"ambient_C", "heat_W"', '"heat_W", "ambient_C"'])
def test_a_first_input_of_one_sine_is_enough_beside_a_second_that_switches(tmp_path, capsys, inputs) -> None:
    assert "note" not in said(tmp_path, capsys, inputs, 0.0)


@pytest.mark.parametrize("inputs", ['"ambient_C", "heat_W"', '"heat_W", "ambient_C"'])
def test_an_actuator_that_bends_is_told_wherever_it_is_named(tmp_path, capsys, inputs) -> None:
    assert "is no noise: the input still explains" in said(tmp_path, capsys, inputs, 0.004)

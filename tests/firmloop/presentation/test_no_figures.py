"""What is no figure is said in words, and is null in JSON: steps that cannot be reached, loops that run away."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from firmloop.cli import main
from firmloop.design.analysis.loop import Margins, StepMetrics, Trajectory
from firmloop.presentation.documents import fields_document, result_json
from firmloop.presentation.words import about_loop
from firmloop.stages.analysis import Loop

PROJECT = """schema = 1
name = "loop"
[plant]
kind = "{kind}"
input = "fan_percent"
outputs = ["temperature_C"]
[plant.parameters]
{parameters}
[controller]
kind = "pid"
period_s = 1.0
{controller}
[signals]
reference = {{ unit = "degC", low = 20, high = 90 }}
measurement = {{ unit = "degC", low = 0, high = 120 }}
output = {{ unit = "percent", low = {low}, high = {high} }}
[arithmetic]
number = "float32"
[target]
names = ["host"]
"""
LAG = "gain = {{ value = {gain}, free = false }}\ntime_constant_s = {{ value = 60, free = false }}\n"
LATE = "delay_s = { value = 6, free = false }\n"
NO_FIGURE = re.compile(r"(?<![\w-])-?(inf|nan)\b")


def designed(folder: Path, capsys: pytest.CaptureFixture[str], text: str) -> tuple[str, dict[str, object]]:
    """Design twice, for the console and for machines; no figure of either is none."""
    (folder / "project.toml").write_text(text)
    said = []
    for flags in ([], ["--json"]):
        assert main(["design", str(folder / "project.toml"), "--out", str(folder / "out"), *flags]) == 0
        said.append(capsys.readouterr().out)
    assert not NO_FIGURE.search(said[0]), said[0]
    return said[0], json.loads(said[1], parse_constant=pytest.fail)


@pytest.mark.parametrize(("gain", "low", "high"), [(-0.8, 0, 100), (0.8, -100, 0), (-3.0, 0, 1000)])
def test_the_step_goes_the_way_that_the_actuator_can(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], gain: float, low: int, high: int
) -> None:
    text = PROJECT.format(
        kind="first_order", parameters=LAG.format(gain=gain) + LATE, controller='tune = "simc"', low=low, high=high
    )
    said, document = designed(tmp_path, capsys, text)
    step = document["controller"]["step"] if "controller" in document else document["design"]["step"]
    assert 5.0 < step["rise_s"] < 60.0 and "not reached" not in said


def test_a_loop_that_runs_away_has_no_step(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = PROJECT.format(
        kind="first_order",
        parameters=LAG.format(gain=0.8) + LATE,
        controller="kp = 900.0\nki = 50.0",
        low=-1e6,
        high=1e6,
    )
    said, _ = designed(tmp_path, capsys, text)
    assert re.search(r"closed loop +UNSTABLE", said) and re.search(r"rise time 10-90 % +none", said)


ANY = st.floats(allow_nan=True, allow_infinity=True)


@given(figures=st.lists(ANY, min_size=14, max_size=14), halves=st.lists(ANY.map(abs), min_size=3, max_size=3))
def test_words_and_documents_hold_no_infinite_figure(figures: list[float], halves: list[float]) -> None:
    margins, metrics = Margins(True, *figures[:6]), StepMetrics(*figures[6:])
    still = Trajectory(*[np.zeros(2)] * 4, np.zeros(2, dtype=bool))
    names = ("gain_margin_db", "rise_s", "overshoot_percent")
    loop = Loop(margins, still, metrics, dict(zip(names, halves, strict=True)), (("here", margins),))
    said = "\n".join(about_loop(loop))
    assert not NO_FIGURE.search(said), said
    written = json.loads(result_json({"step": fields_document(metrics)}), parse_constant=pytest.fail)
    for name, value in written["step"].items():
        assert (value is None) == (not math.isfinite(getattr(metrics, name)))

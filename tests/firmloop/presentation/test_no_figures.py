"""What is no figure is said in words, and is null in JSON: steps that cannot be reached, loops that run away."""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from firmloop.cli import main
from firmloop.design.analysis.loop import Margins, Trajectory
from firmloop.design.analysis.step_metrics import StepMetrics
from firmloop.design.design import Design
from firmloop.diagnose.controller.faults import Fault
from firmloop.diagnose.controller.replay import Blame, Cut
from firmloop.diagnose.finding import Estimate, Finding, Named, Ratio, Shift
from firmloop.identify.fitting.fit import Fit
from firmloop.identify.fitting.scores import RecordingScore, Scores
from firmloop.identify.plants.plant import Parameter
from firmloop.identify.recordings.recording import Recording
from firmloop.identify.signal import Signal
from firmloop.presentation.diagnosis_report import controller_tables, effects_table, ranking_table, shifts_table
from firmloop.presentation.documents import fields_document, fit_document, known, result_json
from firmloop.presentation.sections import comparisons, plant_section, targets_section
from firmloop.presentation.words import about_fit, about_loop, about_outcome
from firmloop.stages.analysis import Loop
from firmloop.stages.data import Data
from firmloop.stages.verification import Outcome
from firmloop.verify.verdict import NO_COST, ClosedLoop, Difference, Rounded, Verdict, Worst
from tests.laws import FULL, pid

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


@pytest.mark.parametrize(
    ("gain", "low", "high"),
    [(-0.8, 0, 100), (0.8, -100, 0), pytest.param(-3.0, 0, 1000, marks=pytest.mark.slow)],
)
def test_the_step_goes_the_way_that_the_actuator_can(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], gain: float, low: int, high: int
) -> None:
    text = PROJECT.format(
        kind="first_order", parameters=LAG.format(gain=gain) + LATE, controller='tune = "simc"', low=low, high=high
    )
    said, document = designed(tmp_path, capsys, text)
    step = document["controller"]["step"] if "controller" in document else document["design"]["step"]
    assert 5.0 < step["rise_s"] < 60.0 and "not reached" not in said
    assert f"every step here is about output {(low + high) / 2:g}, the middle of its range" in said


@pytest.mark.parametrize(
    ("gain", "low", "high", "short"),
    [(-0.8, 20, 100, "-16 of 22.5"), (0.001, 0, 100, "0.1 of 22.5"), (0.8, -5, 5, "4 of 22.5"), (0.8, 0, 100, "")],
)
def test_a_step_beyond_the_actuator_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], gain: float, low: int, high: int, short: str
) -> None:
    text = PROJECT.format(
        kind="first_order", parameters=LAG.format(gain=gain) + LATE, controller='tune = "simc"', low=low, high=high
    )
    said, _ = designed(tmp_path, capsys, text)
    told = re.search(r"reference not reached  (.*), the output at its limit", said)
    assert (told.group(1) if told else "") == short, said


@pytest.mark.parametrize(("controller", "short"), [("kp = 1.0", "10 of 22.5"), ("kp = 1.0\nki = 0.02", "")])
def test_a_step_that_rests_elsewhere_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], controller: str, short: str
) -> None:
    """Without an integral a loop of gain 0.8 rests at 0.8/1.8 of what it was asked for, and settles there."""
    parameters = LAG.format(gain=0.8) + LATE
    text = PROJECT.format(kind="first_order", parameters=parameters, controller=controller, low=0, high=100)
    said, _ = designed(tmp_path, capsys, text)
    told = re.search(r"reference not reached  (.*), where this loop rests", said)
    assert (told.group(1) if told else "") == short, said


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
    assert "no limit" not in said


ANY = st.floats(allow_nan=True, allow_infinity=True)


@given(figures=st.lists(ANY, min_size=14, max_size=14), halves=st.lists(ANY.map(abs), min_size=3, max_size=3))
def test_words_and_documents_hold_no_infinite_figure(figures: list[float], halves: list[float]) -> None:
    margins, metrics = Margins(True, *figures[:6]), StepMetrics(*figures[6:])
    still = Trajectory(np.arange(2.0), *[np.zeros(2)] * 3, np.zeros(2, dtype=bool))
    names = ("gain_margin_db", "rise_s", "overshoot_percent")
    loop = Loop(margins, still, metrics, dict(zip(names, halves, strict=True)), 1e5, (("here", margins),))
    said = "\n".join(about_loop(loop))
    assert not NO_FIGURE.search(said), said
    written = json.loads(result_json({"step": fields_document(metrics)}), parse_constant=pytest.fail)
    for name, value in written["step"].items():
        assert (value is None) == (not math.isfinite(getattr(metrics, name)))


def outcome_of(figures: list[float]) -> Outcome:
    """A difference whose values, rounding and run against the plant are these figures."""
    expected, got, worst, bound, drift, read, *run = figures
    verdict = Verdict(
        program_id="0123456789abcdef", target="host", link="library", compiler="gcc", flags=(), steps=10, lanes=1,
        seed=1, stimuli={"noise": 10}, saturated=0.0, differences=1,
        first=Difference(3, "noise 0", "output", expected, got, "V", "t1 = a + b"),
        rounding=(Rounded("output", worst, bound, "V", drift),),
        cost=replace(NO_COST, worst=Worst(3, "noise 0", {"reference": read})),
        sanitized=10, closed_loop=ClosedLoop(len(run), 1, run, run[::-1], run),
    )  # fmt: skip
    return Outcome("host", verdict, "")


@given(figures=st.lists(ANY, min_size=10, max_size=10))
def test_a_verdict_holds_no_infinite_figure(figures: list[float]) -> None:
    outcome = outcome_of(figures)
    said = "\n".join(about_outcome(outcome))
    assert not NO_FIGURE.search(said), said
    assert outcome.verdict is not None
    json.dumps(outcome.verdict.as_dict(), allow_nan=False)


@pytest.mark.parametrize("odd", [math.nan, math.inf, -math.inf, 1e308])
def test_a_page_draws_a_run_that_left_all_numbers(odd: float) -> None:
    page = "\n".join(targets_section([outcome_of([odd] * 6 + [0.0, 1.0, odd, odd])], Design(pid(FULL), {}, None)))
    shown = re.sub(r"<svg.*?</svg>", lambda found: found.group().partition("<defs")[0], page, flags=re.DOTALL)
    assert not NO_FIGURE.search(shown), shown
    assert not re.search(r"[\s\"]-?(inf|nan)[\s\"]", page), "in a figure"


@settings(max_examples=40, deadline=None)  # each draws a figure
@given(figures=st.lists(ANY, min_size=8, max_size=8))
def test_a_fit_holds_no_infinite_figure(figures: list[float]) -> None:
    value, given_value, deviation, noise, *scored = figures
    parameters = (
        Parameter("R_ohm", "ohm", value, True, 0.0, math.inf, abs(deviation)),
        Parameter("L_H", "H", given_value, False, 0.0, math.inf, None),
    )
    outputs = (Signal("y", "", 0.0, 1.0),)
    plant = SimpleNamespace(kind="first_order", parameters=parameters, inputs=(), outputs=outputs, varying=())
    score = RecordingScore("a.csv", {"y": Scores(*scored)}, np.zeros((2, 1)), np.zeros((1, 1)), {})
    fit = Fit(plant, np.zeros((0, 0)), (), (score,), (), {"y": noise}, (), ())
    data = Data((Recording(np.arange(2.0), {"y": np.zeros(2)}, plant.outputs, "a.csv", ""),), ())
    page = re.sub(r"<svg.*?</svg>", "", "\n".join(plant_section(fit, data)), flags=re.DOTALL)
    for said in ("\n".join(about_fit(fit)), page, comparisons(fit, data)[0].title):
        assert not NO_FIGURE.search(said), said
    json.dumps(fit_document(fit), allow_nan=False)


@given(figures=st.lists(ANY, min_size=12, max_size=12))
def test_a_diagnosis_holds_no_infinite_figure(figures: list[float]) -> None:
    chance, value, low, high, given_value, refit, after, worst, blamed, deviation, one, other = figures
    effect = Named("backlash", None, "torque", chance, {"gap_rad": Estimate(value, (low, high), "rad")}, "")
    shift = Shift("R_ohm", "ohm", given_value, refit, after)
    ratio = Ratio(one, other, None)
    finding = Finding(
        "explained", "plant", None, (effect,), (), ratio, None, (0.5, 0.5), {"y": value}, (shift,), {}, (), (),
    )  # fmt: skip
    fault = Fault("gain_differs", "kp", "V", 1.0, 1.0, True, lambda guess, value: guess)
    blame = Blame(fault, blamed, abs(deviation), SimpleNamespace())
    cut = Cut(1, 2, 1, worst, (blame,), (), False, "u", "V", (), 0.5, ())
    rival = SimpleNamespace(score=one, fitted=SimpleNamespace(terms=()))
    search = SimpleNamespace(nominal=SimpleNamespace(score=other), rounds=((rival,),))
    for said in (*effects_table(finding), shifts_table((shift,)), *controller_tables(cut), ranking_table(search)):
        assert not NO_FIGURE.search(said), said
    json.dumps(known(finding.as_dict()), allow_nan=False)


@pytest.mark.parametrize(("period", "reached"), [(0.01, False), (0.06, True)])
def test_a_step_that_is_not_followed_to_its_rest_is_measured_against_where_it_rests(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], period: float, reached: bool
) -> None:
    """PI cancels the plant's lag, so that the loop is one lag of 750 s; 50,000 samples are 500 s, or 3,000 s."""
    text = PROJECT.format(
        kind="first_order",
        parameters=LAG.format(gain=0.8).replace("60", "600") + LATE.replace("6", "0"),
        controller=f"kp = 1.0\nki = {1 / 600}",
        low=-100,
        high=100,
    ).replace("period_s = 1.0", f"period_s = {period}")
    said, document = designed(tmp_path, capsys, text)
    step = document["controller"]["step"]
    assert "rests only after 9e+03 s" in said
    if reached:
        assert step["rise_s"] == pytest.approx(750 * math.log(9), rel=2e-3)
    else:
        assert step["rise_s"] is None and step["settling_2_s"] is None and "rise time 10-90 %  not reached" in said

"""The report: whole in one file, the same bytes for the same walk, and safe against what names may hold."""

from __future__ import annotations

import dataclasses
import re
import xml.etree.ElementTree as ElementTree
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from bench.links.accessibility import SERIOUS, judged, missing
from bench.links.chromium import browsing
from firmloop.identify.plants.plant import Parameter
from firmloop.presentation import words
from firmloop.presentation.figures import (
    COLUMNS,
    CurvePair,
    Step,
    bode_figure,
    comparison_figure,
    dots,
    overview,
    search_figure,
    step_figure,
    styled,
    svg,
    thinned,
)
from firmloop.presentation.report import Walk, picture, report
from firmloop.project.project import read_project
from firmloop.stages.analysis import analyze
from firmloop.stages.data import read_data
from firmloop.stages.fitting import identify
from firmloop.stages.making import design, generate
from firmloop.stages.tuning import beside
from firmloop.stages.verification import Outcome
from firmloop.verify.verdict import Cost, Difference, Rounded, Searches, Verdict
from firmloop.version import version
from tests.firmloop.conftest import PROJECT

VERDICT = Verdict(
    program_id="0123456789abcdef",
    target="board",
    link="uart",
    compiler="gcc 1.0",
    flags=("-O2",),
    steps=100_000,
    lanes=100,
    seed=1,
    stimuli={"noise": 60_000, "corners": 40_000},
    saturated=0.2,
    differences=0,
    first=None,
    rounding=(Rounded("output", 1e-6, 2e-6, "V", 1e-5),),
    cost=Cost(120.0, 101.5, 90.0, 1500, 4, 64, 48),
    sanitized=0,
)
DIFFERS = dataclasses.replace(
    VERDICT, differences=7, first=Difference(12, "noise 3", "output", 1.5, 1.25, "V", "fl_add(<left>, right)")
)


@pytest.fixture(scope="module")
def walk(tmp_path_factory: pytest.TempPathFactory, recorded_files: dict[str, str]) -> Walk:
    """A walk that no test of this file changes."""
    folder = tmp_path_factory.mktemp("walk")
    for name, text in (*recorded_files.items(), ("tank_heater.toml", PROJECT)):
        (folder / name).write_text(text)
    read = read_project(folder / "tank_heater.toml")
    data = read_data(read)
    fitted = identify(read, data, lambda share, doing: None)
    designed = design(read, fitted.plant)
    made = generate(read, designed, "firmloop run tank_heater.toml")
    outcomes = (Outcome("board", VERDICT, ""), Outcome("other", DIFFERS, ""), Outcome("third", None, "<no port>"))
    return Walk(
        read, "firmloop run x.toml", data, fitted, designed, analyze(read, designed, fitted.plant), made, outcomes
    )


@pytest.fixture(scope="module")
def page(walk: Walk) -> str:
    """Its report, of which figures are drawn for half a second."""
    return report(walk)


class _Checker(HTMLParser):
    """Collects tags that are left open, and whatever would fetch something."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.fetched: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag not in ("meta", "br"):
            self.open.append(tag)
        for name, value in attrs:
            if name in ("src", "href") and not (value or "").startswith("#"):
                self.fetched.append(f"{tag} {name}={value}")

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.handle_starttag(tag, attrs)
        self.open.pop()

    def handle_endtag(self, tag: str) -> None:
        assert self.open and self.open.pop() == tag, f"</{tag}> closes nothing"


def test_report(walk: Walk, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "86400")
    page = report(walk)
    assert page == report(walk)
    assert len(page.encode()) <= 700_000
    checker = _Checker()
    checker.feed(page)
    assert not checker.open and not checker.fetched
    for word in ("<script", "@import", "url(http", "2026"):
        assert word not in page
    cells = re.findall(r"<t[dh][^>]*>([^<]*)<", page)
    assert not [cell for cell in cells if re.search(r"\b(inf|nan|None|null|1e\+?(9|30|300))\b", cell)]
    assert page.count("<svg") == page.count('role="img" aria-label="') == page.count("<svg ")
    names = re.findall(r'<h2 id="([^"]+)">([^<]+)<', page)
    assert names == re.findall(r'<a href="#([^"]+)">([^<]+)<', page) and len(names) == page.count("<h2")
    digests = re.findall(r">SHA-256 of (\w+\.csv)</th><td>([0-9a-f]{64})<", page)
    assert digests == [
        (Path(each.source).name, each.sha256) for each in (*walk.data.train, *walk.data.test)
    ]  # fmt: skip
    assert all(">" + word + "<" in page for word in ("1970-01-02", "gcc 1.0", version()))
    for word in (
        "board: agrees",
        "other: differs",
        "third: not run",
        "100,000 steps, 0 differences",
        "worst 1e-06 V, bound 2e-06 V",
        "120 at most, 101.5 on average",
        "first at step 12 (noise 3): output is 1.25, expected 1.5 V",
        "tank_heater_step(",
        "phase margin",
        "time_constant_s",
        "test: test.csv",
        "firmloop run x.toml",
    ):
        assert word in page, word


def test_what_scrolls_on_a_narrow_screen_can_be_reached_by_keys(page: str) -> None:
    blocks = re.findall(r'<pre[^>]*>|<div class="scroll"[^>]*>', page)
    assert page.count("<svg") == page.count('aria-label="figure: ') and "<pre " in page
    assert all('tabindex="0"' in each and 'aria-label="' in each for each in blocks)


def test_a_tuned_loop_stands_beside_the_other_rules(project: Path, walk: Walk, page: str) -> None:
    project.write_text(project.read_text() + '\n[tuning]\nrules = ["simc", "lambda", "lqr"]\n')
    tuned = beside(read_project(project), walk.design, walk.fit.plant)
    told = report(dataclasses.replace(walk, tuned=tuned))
    assert "Tuning rules on this plant" not in page
    assert (
        "Tuning rules on this plant" in told
        and '<th scope="col">load IAE</th>' in told
        and '<th scope="row">simc</th>' in told
    )


def test_what_a_search_did_stands_beside_its_cost(walk: Walk, page: str) -> None:
    found = Searches(40, ((0, 1, -1), (0, 0, 0)), (14, 0), (900, 300), 60, 20, 2_400, 3, 4, 5)
    searched = dataclasses.replace(VERDICT, searches=found)
    told = report(dataclasses.replace(walk, outcomes=(Outcome("board", searched, ""),)))
    for word in (
        "work 20 at most, cut short at 60",
        "2,400 instructions with the whole budget taken, 20.00 of the worst seen",
        "3 cut short, 4 with no moves that keep every limit; 5 of them with every input in its range",
        "at its high limit",
    ):
        assert word in told and word not in page, word
    assert searched.as_dict()["search"] == {
        "budget": 60, "work_max": 20, "instructions_bound": 2_400, "capped_steps": 3, "infeasible_steps": 4,
        "within_ranges_steps": 5,
    }  # fmt: skip


def test_nothing_a_user_wrote_is_markup(page: str) -> None:
    assert "&lt;no port&gt;" in page and "<no port>" not in page
    assert "fl_add(&lt;left&gt;, right)" in page and "<left>" not in page


def test_picture_is_one_svg(walk: Walk) -> None:
    text = picture(walk)
    assert ElementTree.fromstring(text).tag.endswith("svg")
    assert "board: 100,000 steps, 0 differences: agrees" in text


def _comparison(rows: int) -> CurvePair:
    time = np.arange(rows) * 1e-3
    noise = np.random.default_rng(1).normal(size=rows)
    return CurvePair("a <title> & $x$", "speed_rad_s", "rad/s", time, noise, 0 * noise)


def test_figures_escape_and_repeat() -> None:
    step = Step(np.arange(9.0), np.ones(9), np.ones(9), np.ones(9), "rad/s", "V", (-1e9, 1e9))
    searches = Searches(40, ((0, 1, -1), (0, 0, 0)), (14, 0), (900, 300), 60, 20, 2_000, 3, 4, 5)
    for make in (
        lambda: comparison_figure(_comparison(50)),
        lambda: search_figure(searches),
        lambda: step_figure(step),
        lambda: overview(_comparison(50), step, ["<x>"]),
    ):
        text = make()
        assert text == make()
        ElementTree.fromstring(text)
    assert "a &lt;title&gt; &amp; $x$" in comparison_figure(_comparison(50))


def test_every_axis_has_its_unit_and_the_input_is_drawn() -> None:
    drawn = dataclasses.replace(_comparison(50), inputs=(("voltage_V", "V", np.ones(50)), ("share", "", np.ones(50))))
    assert axes_of(comparison_figure(drawn)) == [
        "speed_rad_s rad/s",
        "residual rad/s",
        "voltage_V V",
        "share 1",
        "time, s",
    ]
    step = Step(np.arange(9.0), np.ones(9), np.ones(9), np.ones(9), "rad/s", "V", (-1e9, 1e9))
    assert axes_of(step_figure(step)) == ["measurement rad/s", "output V", "time, s"]


def test_the_open_loop_is_drawn_with_its_interval(walk: Walk, page: str) -> None:
    """At the crossover the gain is 0 dB, and the phase is the margin above -180 deg, each within its interval."""
    assert walk.loop is not None and walk.loop.bode is not None
    bode, margins = walk.loop.bode, walk.loop.margins
    at = np.interp(np.log(margins.crossover_rad_s), np.log(bode.frequency), bode.gain)
    assert at == pytest.approx(0.0, abs=0.05)
    phase = np.interp(np.log(margins.crossover_rad_s), np.log(bode.frequency), bode.phase)
    assert (phase + 180.0) % 360.0 == pytest.approx(margins.phase_margin_deg, abs=0.5)
    assert bode.gain_half is not None and np.all(bode.gain_half >= 0.0) and bode.gain_half.max() > 0.0
    text = bode_figure(bode, margins.crossover_rad_s)
    assert text == bode_figure(bode, margins.crossover_rad_s) and text in page
    assert "$" not in text
    for word in ("frequency, rad/s", "dB", "deg", "open loop, with 95 % intervals"):
        assert f">{word}<" in text, word


def axes_of(picture: str) -> list[str]:
    """Return the names of the axes of a picture: what stands upright, in its lines, then what lies below."""
    groups = re.findall(r"<g id=\"text_\d+\">(.*?)</g>", picture, re.DOTALL)
    upright = [re.findall(r">([^<>\n]+)</(?:text|tspan)>", group) for group in groups if "rotate(-90" in group]
    return [" ".join(words) for words in upright] + re.findall(r">(time, s)<", picture)


def test_many_dots_are_one_short_path() -> None:
    with styled(3, 2) as figure:
        axes = figure.subplots()
        dots(axes, np.arange(1200.0), np.arange(1200.0) % 7, "#e4572e")
        text = svg(figure)
    ElementTree.fromstring(text)
    assert text.count("<use") < 40 and len(text) < 30_000
    (path,) = [d for d in re.findall(r' d="([^"]*)"', text) if "h0" in d]
    assert path.count("h0") == 1200


@pytest.mark.skipif(missing() != "", reason=missing() or "all is there")
def test_axe_has_no_serious_finding_in_the_report_and_one_in_a_page_that_is_wrong(page: str, tmp_path: Path) -> None:
    wrong = '<html lang="en"><title>x</title><main><h1>x</h1><input></main></html>'
    with browsing() as browser:
        for name, text, rules in (("report", page, []), ("wrong", wrong, ["label"])):
            (tmp_path / name).with_suffix(".html").write_text(text)
            for _, found in judged(browser, (tmp_path / f"{name}.html").as_uri()):
                assert [each.rule for each in found if each.impact in SERIOUS] == rules, found


def test_long_recordings_stay_small() -> None:
    assert len(comparison_figure(_comparison(1_000_000))) < 150_000
    time, values = np.arange(100_000.0), np.zeros(100_000)
    values[77_777] = 5.0
    thin_time, thin_values = thinned(time, values, COLUMNS)
    assert len(thin_time) <= 2 * COLUMNS + 2 and thin_time[0] == 0 and thin_time[-1] == 99_999
    assert thin_values.max() == 5.0 and thin_time[np.argmax(thin_values)] == 77_777
    assert np.all(np.diff(thin_time) > 0)


@pytest.mark.parametrize(
    ("value", "deviation", "words_of_it"),
    [
        (8.01234, 0.0123, ("8.012", "± 0.024", "ohm")),
        (123456.0, 1000.0, ("1.235e+05", "± 2e+03", "ohm")),
        (1.23456e-6, 2e-9, ("1.2346e-06", "± 3.9e-09", "ohm")),
        (0.001, 5.0, ("0.0010", "± 9.8", "ohm")),
        (0.0, 1.0, ("0", "± 2", "ohm")),
        (8.01234, None, ("8.0", "interval unknown", "ohm")),
    ],
)
def test_no_more_digits_than_the_interval_allows(
    value: float, deviation: float | None, words_of_it: tuple[str, ...]
) -> None:
    assert words.estimate(Parameter("R_ohm", "ohm", value, True, 0.0, 1e9, deviation)) == words_of_it

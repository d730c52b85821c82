"""The page in a headless Chromium draws the values that were sent, and its sliders move the target's parameters."""

from __future__ import annotations

import base64
import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from bench.links.accessibility import SERIOUS, judged, missing
from bench.links.chromium import Browser, browsing, chromium
from bench.links.scope import SIGNALS, Running, scoping
from firmloop.identify.recordings.recording import read_recording

pytestmark = [
    pytest.mark.qemu,
    pytest.mark.skipif(chromium() is None, reason="no browser here; install it: apt-get install chromium"),
]


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with browsing() as started:
        yield started


@pytest.fixture(scope="module")
def scope(tmp_path_factory: pytest.TempPathFactory, browser: Browser) -> Iterator[Running]:
    with scoping(tmp_path_factory.mktemp("page")) as running_scope:
        browser.open(running_scope.url)
        browser.wait("store.length > 1500")
        yield running_scope


def place(browser: Browser, step: float) -> tuple[float, float]:
    """Return where a step stands in the window, in the first pane."""
    x, y = browser.ask(
        f"(() => {{ const box = canvas.getBoundingClientRect(); panes.layout(); const pane = panes.visible[0]; "
        f"return [box.left + panes.xOf(view, {step}), box.top + pane.top + pane.high / 2]; }})()"
    )
    return x, y


INK = 3  # pixels: half of a mark, which is 4 high, and what its edge shades
PIXELS = """((signal, steps) => {
  const pane = panes.visible.find((each) => each.members.includes(signal));
  const pen = canvas.getContext("2d");
  const parts = (hex) => [1, 3, 5].map((at) => parseInt(hex.slice(at, at + 2), 16));
  const ground = [255, 255, 255];
  const way = parts(panes.ink(signal)).map((part, c) => part - ground[c]);
  const length = way.reduce((sum, part) => sum + part * part, 0);
  const span = pane.range[1] - pane.range[0];
  const value = (y) => pane.range[1] - ((y - pane.top) / pane.high) * span;
  return steps.map((step) => {
    const column = pen.getImageData(Math.floor(panes.xOf(view, step)), 0, 1, canvas.height).data;
    const rows = [];
    for (let y = Math.ceil(pane.top) + 20; y < pane.top + pane.high; y++) {
      const off = ground.map((part, c) => column[4 * y + c] - part);
      const covered = off.reduce((sum, part, c) => sum + part * way[c], 0) / length;
      const rest = Math.hypot(...off.map((part, c) => part - covered * way[c]));
      if (covered > 0.4 && rest < 40) rows.push(y);
    }
    return [value(Math.max(...rows) + 1), value(Math.min(...rows)), span / pane.high];
  });
})"""


def drawn(browser: Browser, signal: int, steps: list[float]) -> list[list[float]]:
    """Return, for each step, the lowest and highest value that has the ink of a signal, and what a pixel is worth."""
    return browser.ask(f"{PIXELS}({signal}, {json.dumps(steps)})")


def sent(browser: Browser, signal: int, step: float, off: float) -> list[float]:
    """Return the lowest and highest value that came for the steps within `off` of one."""
    return browser.ask(f"store.extent({signal}, store.find({step - off}) - 1, store.find({step + off}) + 1)")


def test_the_page_is_whole_and_needs_nothing_from_elsewhere(scope: Running, browser: Browser) -> None:
    assert browser.complaints == []
    assert browser.ask("performance.getEntriesByType('resource').every((e) => e.name.startsWith(location.origin))")
    assert browser.ask("document.querySelectorAll('[src], link[href]:not([href^=\"data:\"])').length") == 0
    shown = browser.ask("Array.from(document.querySelectorAll('#signals tr'), (row) => row.innerText.trim())")
    assert [line.split()[0] for line in shown] == list(SIGNALS)
    unnamed = browser.ask(
        "Array.from(document.querySelectorAll('input, select, button, canvas')).filter((e) => "
        "!(e.labels?.length || e.ariaLabel || e.textContent.trim())).map((e) => e.id)"
    )
    assert unnamed == []


def test_what_is_drawn_is_what_was_sent(scope: Running, browser: Browser) -> None:
    browser.ask(
        "setPaused(true), element('range').value = 'project', element('range').dispatchEvent(new Event('change'))"
    )
    browser.wait("store.last > 2000")
    for width in (2000, 60):  # of many samples to a pixel, and of many pixels to a sample
        browser.ask(f"view.width = {width}, view.show(Math.max(0, store.last - {width})), picture()")
        begin, end = browser.ask("[view.begin, view.end]")
        pixel_steps = (end - begin) / browser.ask("panes.wide")
        for signal in (1, 2):
            steps = [begin + (end - begin) * share for share in (0.11, 0.29, 0.47, 0.64, 0.83)]
            for step, (low, high, pixel) in zip(steps, drawn(browser, signal, steps), strict=True):
                lowest, highest = sent(browser, signal, step, 2 * pixel_steps)
                assert lowest - INK * pixel <= low <= high <= highest + INK * pixel


def test_cursors_tell_the_values_under_them(scope: Running, browser: Browser) -> None:
    browser.ask("setPaused(true), view.width = 100, view.show(Math.max(0, store.last - 600)), picture()")
    begin = browser.ask("view.begin")
    for step, shift in ((begin + 20, False), (begin + 80, True)):
        browser.point(*place(browser, step), click=True, shift=shift)
    browser.wait("element('output-ab').textContent !== ''")
    a, b = browser.ask("[cursors.a, cursors.b]")
    assert (a, b) == (pytest.approx(begin + 20, abs=1), pytest.approx(begin + 80, abs=1))
    k = SIGNALS.index("output")
    at_a, at_b = (browser.ask(f"store.signal({k})[store.find({step})]") for step in (a, b))
    browser.wait(f"element('time-a').textContent === shownNumber({a} * period)")
    assert float(str(browser.ask("element('output-a').textContent"))) == pytest.approx(at_a, rel=1e-5)
    assert float(str(browser.ask("element('output-ab').textContent"))) == pytest.approx(at_b - at_a, rel=1e-5, abs=1e-9)
    assert float(str(browser.ask("element('time-ab').textContent"))) == pytest.approx((b - a) * 1e-3)
    browser.ask("canvas.dispatchEvent(new KeyboardEvent('keydown', { key: 'Escape' }))")
    browser.wait("element('output-a').textContent === ''")


def test_pause_holds_the_view_while_samples_come(scope: Running, browser: Browser) -> None:
    browser.ask("setPaused(true)")
    begin, count = browser.ask("[view.begin, store.base + store.length]")
    browser.wait(f"store.base + store.length > {count} + 300")
    assert browser.ask("view.begin") == begin
    browser.ask("element('pause').click()")
    browser.wait(f"view.begin > {begin}")


def test_the_trigger_shows_sweeps_from_its_crossing_on(scope: Running, browser: Browser) -> None:
    """The reference steps from -25 to 60 once in two seconds."""
    for name, value in (("channel", "0"), ("level", "10"), ("edge", "rising"), ("mode", "single")):
        browser.ask(
            f"element('trigger-{name}').value = '{value}', element('trigger-{name}').dispatchEvent(new Event('change'))"
        )
    browser.ask("element('trigger-level').value = '10', view.width = 400, setTrigger()")
    browser.wait("view.paused", 120)
    at = browser.ask("trigger.at")
    before, after = browser.ask(f"[store.signal(0)[store.find({at}) - 1], store.signal(0)[store.find({at})]]")
    assert (before, after) == (-25.0, 60.0)
    assert browser.ask("(trigger.at - view.begin) / view.width") == pytest.approx(0.1)
    browser.ask("element('trigger-mode').value = 'off', setTrigger()")


def test_a_slider_moves_the_parameter_on_the_target(scope: Running, browser: Browser) -> None:
    k = SIGNALS.index("kp")
    assert browser.ask("[element('slider-kp').min, element('slider-kp').max].map(Number)") == [
        0.0,
        float(np.float32(0.2)),
    ]
    browser.ask("element('slider-kp').value = 0.125, element('slider-kp').dispatchEvent(new Event('input'))")
    browser.wait(f"store.signal({k})[store.length - 1] === 0.125")
    browser.wait("element('tunables').innerText.includes('set from')")
    browser.ask("tunables.want('kp', 0.3)")
    browser.wait("element('tunables').innerText.includes('kp=0.3: is beyond its proven range, 0 to 0.2')")
    assert browser.ask(f"store.signal({k})[store.length - 1]") == 0.125


def test_zoom_and_scales_follow_the_wheel(scope: Running, browser: Browser) -> None:
    browser.ask("setPaused(true), view.width = 1000, view.show(Math.max(0, store.last - 1000)), picture()")
    wheel = "new WheelEvent('wheel', {{ deltaY: -1, clientX: {x}, clientY: {y} }})"
    x, y = place(browser, float(browser.ask("(view.begin + view.end) / 2")))
    middle = browser.ask("(view.begin + view.end) / 2")
    browser.ask(f"canvas.dispatchEvent({wheel.format(x=x, y=y)})")
    assert browser.ask("view.width") == pytest.approx(800)
    assert browser.ask("(view.begin + view.end) / 2") == pytest.approx(middle, abs=3)
    left = browser.ask("canvas.getBoundingClientRect().left + 20")
    before = browser.ask("panes.visible[0].range")
    browser.ask(f"canvas.dispatchEvent({wheel.format(x=left, y=y)}), picture()")
    after = browser.ask("panes.visible[0].range")
    assert after[1] - after[0] == pytest.approx(0.8 * (before[1] - before[0]))
    browser.ask("panes.panes.forEach((pane) => { pane.held = null; }), setPaused(false)")


@pytest.mark.skipif(missing() != "", reason=missing() or "all is there")
def test_the_page_has_no_serious_finding_of_axe(scope: Running, browser: Browser) -> None:
    for _, found in judged(browser, scope.url, "store.length > 500"):
        assert [each for each in found if each.impact in SERIOUS] == []


def test_the_page_is_a_picture_at_every_size(scope: Running, browser: Browser) -> None:
    for width, height in ((1200, 900), (400, 900)):
        browser.open(scope.url, width, height)
        browser.wait("store.length > 1500")
        assert browser.ask("document.documentElement.scrollWidth <= window.innerWidth")
        assert base64.b64decode(browser.picture()).startswith(b"\x89PNG")
    browser.open(scope.url)
    browser.wait("store.length > 1500")


def test_the_page_says_how_it_ended_and_holds_what_the_recording_holds(scope: Running, browser: Browser) -> None:
    assert scope.stop() == 0
    browser.wait("over !== ''")
    assert browser.ask("element('state').textContent") == "the watch has ended"
    shown = np.array(browser.ask("store.columns.map((column) => Array.from(column.subarray(0, store.length)))"))
    recording = read_recording(Path(scope.file), {})
    assert browser.ask("store.base") == 0
    kept = np.array([np.round(recording.time / 1e-3), *recording.columns.values()])
    np.testing.assert_array_equal(shown, kept)
    assert browser.complaints == []

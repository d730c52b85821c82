"""Ask axe-core what readers with a keyboard or a screen reader cannot use: `python -m bench.links.accessibility`.

    python -m bench.links.accessibility                  the report of the example, and the scope on an emulated core
    python -m bench.links.accessibility out/report.html  pages of your own

Each page is judged wide and narrow, light and dark. It needs Chromium, and axe-core: `npm pack axe-core`, unpack it,
and name its axe.min.js in AXE_CORE, or `npm install axe-core` in this folder. The exit status is 1 where a finding is
serious or critical, 3 where something is not installed.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from bench.links.chromium import Browser, browsing, chromium
from bench.links.scope import scoping

ROOT = Path(__file__).parents[2]
EXAMPLE = ROOT / "examples" / "wheel_speed" / "wheel_speed.toml"
BUNDLE = Path("axe-core") / "axe.min.js"
PLACES = (Path("node_modules"), Path("/usr/local/lib/node_modules"), Path("/usr/lib/node_modules"))
LOOKS = ((1200, "light"), (1200, "dark"), (400, "light"))  # width in pixels, and colours
SERIOUS = ("serious", "critical")
RUN = """axe.run(document, {resultTypes: ["violations"]}).then((found) => found.violations.map((each) =>
  [each.impact, each.id, each.help, each.nodes.map((node) => [node.target.join(" "), node.failureSummary])]))"""


@dataclass(frozen=True, slots=True)
class Complaint:
    """One rule that a page breaks; `nodes` are the places, each with what would mend it."""

    impact: str
    rule: str
    says: str
    nodes: tuple[tuple[str, str], ...]


def axe() -> Path | None:
    """Return the file of axe-core: of AXE_CORE, or where npm puts it."""
    named = [Path(os.environ["AXE_CORE"])] if os.environ.get("AXE_CORE") else []
    return next((file for file in (*named, *(place / BUNDLE for place in PLACES)) if file.is_file()), None)


def missing() -> str:
    """Say what is not installed; blank where all is."""
    if chromium() is None:
        return "no browser here: apt-get install chromium"
    return "" if axe() is not None else "no axe-core here: npm pack axe-core, unpack it, AXE_CORE=package/axe.min.js"


def complaints(browser: Browser) -> list[Complaint]:
    """Judge the page that is open, as it is."""
    file = axe()
    assert file is not None, "ask missing() first"
    browser.ask(f"{file.read_text()}\n;0")
    found = browser.ask(RUN)
    assert isinstance(found, list)
    return [Complaint(*each[:3], tuple(map(tuple, each[3]))) for each in found]


def judged(browser: Browser, url: str, ready: str = "true") -> Iterator[tuple[str, list[Complaint]]]:
    """Open a page in each look, wait until it is `ready`, and judge it."""
    for width, colours in LOOKS:
        browser.colours(colours)
        browser.open(url, width)
        browser.wait(ready)
        yield f"{width} px, {colours}", complaints(browser)


def told(name: str, look: str, found: list[Complaint]) -> int:
    """Print what was found; return how much of it is serious."""
    serious = [each for each in found if each.impact in SERIOUS]
    print(f"{name}, {look}: {len(serious)} serious, {len(found) - len(serious)} lesser")
    for each in found:
        print(f"  {each.impact} {each.rule}: {each.says} ({len(each.nodes)})")
        for place, summary in each.nodes[:3]:
            print(f"    {place}: {' '.join(summary.split())[:200]}")
    return len(serious)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("pages", nargs="*", type=Path, help="files of HTML")
    pages = parser.parse_args().pages
    if lacks := missing():
        print(lacks)
        return 3
    serious = 0
    with tempfile.TemporaryDirectory() as folder, browsing() as browser:
        for page in pages or [example(Path(folder))]:
            for look, found in judged(browser, page.resolve().as_uri()):
                serious += told(page.name, look, found)
        if not pages:
            with scoping(Path(folder)) as scope:
                for look, found in judged(browser, scope.url, "store.length > 500"):
                    serious += told("scope", look, found)
    return int(serious > 0)


def example(folder: Path) -> Path:
    """Walk the example's whole way on this machine; return its report."""
    command = [sys.executable, "-m", "firmloop", "run", str(EXAMPLE), "--target", "host", "--out", str(folder / "out")]
    subprocess.run([*command, "--steps", "2000"], check=True, capture_output=True, cwd=ROOT)
    return folder / "out" / "report.html"


if __name__ == "__main__":
    raise SystemExit(main())

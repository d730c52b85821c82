"""The pages say what the code says: generated pages are fresh, links lead somewhere, what is printed is true."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from firmloop.cli import main
from firmloop.diagnose.finding import Finding, Ratio

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
PAGES = sorted(
    [*DOCS.rglob("*.md"), ROOT / "README.md", ROOT / "CHANGELOG.md", *(ROOT / "examples").rglob("README.md")]
)
AVOIDED = ("undo what soaks", "soaks", "what lasts", "leads out", "is told", "is none", "amounts to")


def _id(path: Path) -> str:
    return str(path.relative_to(ROOT))


def _run(command: list[str]) -> subprocess.CompletedProcess[str]:
    kept = {**os.environ, "PYTHONPATH": str(ROOT), "NO_MKDOCS_2_WARNING": "1"}
    return subprocess.run(command, capture_output=True, text=True, cwd=ROOT, env=kept, timeout=300, check=False)


def _tables(page: str) -> list[list[str]]:
    """Return the cells of every row of a page's tables."""
    lines = (DOCS / page).read_text(encoding="utf-8").splitlines()
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines if line.startswith("| ")]


def test_reference_pages_are_fresh() -> None:
    done = _run([sys.executable, "docs/reference.py", "--check"])
    assert done.returncode == 0, done.stderr[-800:]


def test_the_site_builds_without_a_warning(tmp_path: Path) -> None:
    done = _run([sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(tmp_path / "site")])
    assert done.returncode == 0, done.stderr[-2000:]
    assert (tmp_path / "site" / "reference" / "effects.html").is_file()


@pytest.mark.parametrize("path", PAGES, ids=_id)
def test_links_of_a_page_lead_to_files(path: Path) -> None:
    text = re.sub(r"```.*?```", "", path.read_text(encoding="utf-8"), flags=re.DOTALL)
    for link in re.findall(r"\]\(([^)\s]+)\)", text):
        if not link.startswith(("http", "#")):
            assert (path.parent / link.partition("#")[0]).exists(), f"{link} is not there"


@pytest.mark.parametrize("path", [path for path in PAGES if "reference" not in path.parts], ids=_id)
def test_words_of_a_page_are_plain(path: Path) -> None:
    text = path.read_text(encoding="utf-8").lower()
    assert not [words for words in AVOIDED if words in text]


def test_readme_and_changelog_are_short() -> None:
    for name, most in (("README.md", 130), ("CHANGELOG.md", 60)):
        assert len((ROOT / name).read_text(encoding="utf-8").splitlines()) <= most, name


@pytest.mark.parametrize("path", PAGES, ids=_id)
def test_benchmarks_of_a_page_exist(path: Path) -> None:
    for name in re.findall(r"python -m (bench\.[a-z_.]+)\b", path.read_text(encoding="utf-8")):
        place = ROOT.joinpath(*name.split("."))
        assert place.with_suffix(".py").is_file() or (place / "__main__.py").is_file(), f"{name} is not there"


def test_files_of_the_ten_changes_exist() -> None:
    rows = [row for row in _tables("architecture.md") if row[-1].isdigit()]
    assert len(rows) == 10
    for change, files, count in rows:
        paths = re.findall(r"`([^`]+)`", files)
        assert len(paths) == int(count) <= 3, change
        for path in paths:
            named = ROOT / path.replace("PLACE", "torque")
            there = named.parent if "NAME" in path else named
            assert there.exists(), f"{change}: {path} is not there"


def test_an_example_folder_tells_what_it_is() -> None:
    for folder in sorted(path.parent for path in (ROOT / "examples").rglob("*.toml")):
        text = (folder / "README.md").read_text(encoding="utf-8")
        for project in folder.glob("*.toml"):
            assert project.name in text, f"{folder.name}/README.md does not name {project.name}"


def test_every_key_of_a_result_is_on_its_page() -> None:
    for page, schema in (("diagnosis_json.md", "diagnosis"), ("verdict_json.md", "verdict")):
        text = (DOCS / page).read_text(encoding="utf-8")
        known = json.loads((ROOT / "tests" / "schema" / f"{schema}.schema.json").read_text())
        keys = {*known["required"], *known["properties"]}
        assert not [key for key in keys if f"`{key}`" not in text], page


def test_every_key_of_a_finding_is_on_its_page() -> None:
    text = (DOCS / "diagnosis_json.md").read_text(encoding="utf-8")
    nothing = Ratio(None, None, None)
    found = Finding(
        "no_mismatch", "none", None, (), (), nothing, nothing, (0.5, 0.5), {}, (), {}, (), (), law=((0.0, 1.0),)
    )
    assert not [key for key in found.as_dict() if f"`{key}`" not in text]


def test_every_key_of_a_written_verdict_is_on_its_page(tmp_path: Path) -> None:
    text = (DOCS / "verdict_json.md").read_text(encoding="utf-8")
    project = ROOT / "examples" / "own_motor" / "motor.toml"
    lines = project.read_text(encoding="utf-8").replace('tune = "simc"', "kp = 0.1\nki = 2.5").splitlines()
    kept = [line for line in lines if not line.startswith(("tau_c_s", "[tuning]", "rules"))]
    begin, end = (next(k for k, line in enumerate(kept) if line == part) for part in ("[recordings]", "[controller]"))
    own = tmp_path / "motor.toml"
    own.write_text("\n".join([*kept[:begin], *kept[end:]]))
    out = tmp_path / "out"
    assert main(["verify", str(own), "--out", str(out), "--target", "host", "--steps", "100"]) == 0
    for name in ("verdict.json", "manifest.json"):
        written = json.loads((out / name).read_text())
        keys = [*written, *written.get("cost", ())]
        assert not [key for key in keys if f"`{key}`" not in text], name

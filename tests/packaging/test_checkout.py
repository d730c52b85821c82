"""A checkout can be set up or says why not, and its folders can be read at a glance."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
MOST = 20  # files beside one another
FOLDERS = sorted(
    folder
    for top in ("tests", "bench", "scripts", "examples", "docs", "templates_c", "targets")
    for folder in (ROOT / top, *(ROOT / top).rglob("*"))
    if folder.is_dir() and "__pycache__" not in folder.parts
)


def test_a_checkout_without_links_is_refused_by_setup_with_the_way_out(tmp_path: Path) -> None:
    (tmp_path / "scripts").mkdir()
    shutil.copy(ROOT / "scripts" / "setup", tmp_path / "scripts" / "setup")
    (tmp_path / "firmloop").mkdir()
    (tmp_path / "firmloop" / "identify").write_text("../identify")  # what git writes for a link where there are none
    done = subprocess.run([str(tmp_path / "scripts" / "setup")], capture_output=True, text=True, check=False)
    assert done.returncode == 3
    assert "firmloop/identify is no folder" in done.stderr and "core.symlinks=true" in done.stderr
    assert not (tmp_path / ".venv").exists()


@pytest.mark.parametrize("folder", FOLDERS, ids=lambda folder: str(folder.relative_to(ROOT)))
def test_a_folder_holds_no_more_files_than_one_looks_through(folder: Path) -> None:
    assert sum(path.is_file() for path in folder.iterdir()) <= MOST

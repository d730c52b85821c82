"""Results appear whole or not at all."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from firmloop.codegen.bundle import write_files
from firmloop.identify.recordings.recording import Recording, write_recording
from firmloop.output import results_file, results_folder
from firmloop.project.table import ProjectError


def _tree(folder: Path) -> dict[str, str]:
    return {str(p.relative_to(folder)): p.read_text() if p.is_file() else "/" for p in sorted(folder.rglob("*"))}


def test_new_folder(tmp_path: Path) -> None:
    with results_folder(tmp_path / "a" / "b", ()) as folder:
        (folder / "x").write_text("1")
        assert not (tmp_path / "a" / "b").exists()
    assert _tree(tmp_path) == {"a": "/", "a/b": "/", "a/b/x": "1"}
    assert (tmp_path / "a" / "b").stat().st_mode & 0o777 == 0o755


def test_failure_leaves_nothing(tmp_path: Path) -> None:
    with pytest.raises(RuntimeError), results_folder(tmp_path / "a" / "b", ()) as folder:
        (folder / "x").write_text("1")
        raise RuntimeError
    assert _tree(tmp_path) == {}


@pytest.mark.parametrize("stop", [KeyboardInterrupt, SystemExit])
def test_interruption_leaves_nothing(stop: type[BaseException], tmp_path: Path) -> None:
    with pytest.raises(stop), results_folder(tmp_path / "a", ()) as folder:
        (folder / "x").write_text("1")
        raise stop
    assert _tree(tmp_path) == {}


def test_used_folder_keeps_what_is_not_ours(tmp_path: Path) -> None:
    (tmp_path / "notes").write_text("mine")
    (tmp_path / "x").write_text("old")
    with results_folder(tmp_path, ()) as folder:
        (folder / "x").write_text("new")
        (folder / "deep").mkdir()
        (folder / "deep" / "y").write_text("2")
        assert (tmp_path / "x").read_text() == "old"
    assert _tree(tmp_path) == {"deep": "/", "deep/y": "2", "notes": "mine", "x": "new"}


def test_failure_in_a_used_folder_changes_nothing(tmp_path: Path) -> None:
    (tmp_path / "x").write_text("old")
    with pytest.raises(RuntimeError), results_folder(tmp_path, ("x",)) as folder:
        (folder / "x").write_text("new")
        raise RuntimeError
    assert _tree(tmp_path) == {"x": "old"}


def test_a_verdict_of_an_older_run_goes(tmp_path: Path) -> None:
    (tmp_path / "verdict_board.json").write_text("old")
    (tmp_path / "verdict.json").write_text("old")
    with results_folder(tmp_path, ("verdict.json", "verdict_*.json")) as folder:
        (folder / "verdict.json").write_text("new")
    assert _tree(tmp_path) == {"verdict.json": "new"}


def test_a_folder_in_the_way_of_a_file(tmp_path: Path) -> None:
    (tmp_path / "x").mkdir()
    (tmp_path / "w").write_text("old")
    with pytest.raises(ProjectError, match="x is a folder"), results_folder(tmp_path, ()) as folder:
        (folder / "w").write_text("new")
        (folder / "x").write_text("new")
    assert _tree(tmp_path) == {"w": "old", "x": "/"}


def test_out_is_a_file(tmp_path: Path) -> None:
    (tmp_path / "f").write_text("mine")
    for place in (tmp_path / "f", tmp_path / "f" / "deep"):
        with pytest.raises(ProjectError, match="--out"), results_folder(place, ()):
            raise AssertionError
    assert _tree(tmp_path) == {"f": "mine"}


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_out_cannot_be_written(tmp_path: Path) -> None:
    tmp_path.chmod(0o555)
    with pytest.raises(ProjectError, match="Permission denied"), results_folder(tmp_path / "a", ()):
        raise AssertionError


def test_a_file_takes_its_place_whole(tmp_path: Path) -> None:
    out = tmp_path / "deep" / "y.csv"
    with results_file(out) as partial:
        partial.write_text("1")
        assert not out.exists()
    assert _tree(tmp_path) == {"deep": "/", "deep/y.csv": "1"}


def test_a_file_after_a_failure_is_as_before(tmp_path: Path) -> None:
    (tmp_path / "y.csv").write_text("old")
    with pytest.raises(RuntimeError), results_file(tmp_path / "y.csv") as partial:
        partial.write_text("new")
        raise RuntimeError
    assert _tree(tmp_path) == {"y.csv": "old"}


@pytest.mark.parametrize("name", ["y.txt", "", "y.npz"])
def test_a_file_that_is_no_csv(name: str, tmp_path: Path) -> None:
    with pytest.raises(ProjectError, match="--out"), results_file(tmp_path / name):
        raise AssertionError


@pytest.mark.parametrize(
    ("mask", "file", "folder"), [(0o077, 0o600, 0o700), (0o022, 0o644, 0o755), (0o002, 0o664, 0o775)]
)
def test_what_the_user_gets_follows_the_umask(mask: int, file: int, folder: int, tmp_path: Path) -> None:
    times = np.arange(3.0)
    before = os.umask(mask)
    try:
        with results_folder(tmp_path / "out", ()) as place:
            write_files({"a.c": "", "inner/b.c": ""}, place)
        with results_file(tmp_path / "log" / "r.csv") as path:
            write_recording(Recording(times, {"u_V": times}, (), "r.csv", ""), path)
    finally:
        os.umask(before)
    for name in ("out/a.c", "out/inner/b.c", "log/r.csv"):
        assert (tmp_path / name).stat().st_mode & 0o777 == file
    for name in ("out", "out/inner"):
        assert (tmp_path / name).stat().st_mode & 0o777 == folder

"""The host compiler's cache and its errors."""

from __future__ import annotations

import ctypes
import os
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from firmloop.identify.simulation import library_cache
from firmloop.identify.simulation.compiler import ToolError, cache_folder, find_tool, run_compiler, shared_library
from firmloop.identify.simulation.scratch import make_scratch

ANSWER = {"answer.c": '#include "answer.h"\nint answer(void) { return ANSWER; }\n', "answer.h": "#define ANSWER 42\n"}


@pytest.fixture
def fresh_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    return tmp_path / "firmloop"


def test_library_is_built_once_and_again_when_any_text_changes(fresh_cache: Path) -> None:
    first = shared_library(ANSWER, ["answer.c"], ["-O1"])
    assert ctypes.CDLL(str(first)).answer() == 42
    stamp = first.stat().st_mtime_ns
    assert shared_library(ANSWER, ["answer.c"], ["-O1"]) == first
    assert first.stat().st_mtime_ns == stamp
    other = shared_library({**ANSWER, "answer.h": "#define ANSWER 7\n"}, ["answer.c"], ["-O1"])
    assert ctypes.CDLL(str(other)).answer() == 7
    assert shared_library(ANSWER, ["answer.c"], ["-O0"]) not in (first, other)
    assert all(path.suffix == ".so" for path in fresh_cache.iterdir())


def test_two_builders_of_one_library_do_not_disturb_each_other(fresh_cache: Path) -> None:
    with ThreadPoolExecutor(8) as pool:
        found = set(pool.map(lambda _: shared_library(ANSWER, ["answer.c"], ["-O2"]), range(8)))
    assert len(found) == 1
    assert ctypes.CDLL(str(found.pop())).answer() == 42


def test_faulty_source_shows_the_compilers_first_words(fresh_cache: Path) -> None:
    with pytest.raises(ToolError, match=r"gcc failed with status 1:\n(.*\n)*.*broken\.c") as refused:
        shared_library({"broken.c": "int answer(void) { return nothing; }\n"}, ["broken.c"], [])
    assert "nothing" in str(refused.value)
    assert list(fresh_cache.iterdir()) == []


def test_missing_tool_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(ToolError, match="gcc is not installed; install it with: apt-get install gcc"):
        find_tool("gcc")
    with pytest.raises(ToolError, match="libnewlib-arm-none-eabi"):
        find_tool("arm-none-eabi-gcc")
    with pytest.raises(ToolError, match="put it on PATH"):
        run_compiler(["no-such-compiler"], tmp_path)


def test_cache_that_others_can_write_is_refused(fresh_cache: Path) -> None:
    fresh_cache.mkdir(parents=True)
    fresh_cache.chmod(0o777)
    with pytest.raises(ToolError, match="can be written by others"):
        cache_folder()


def test_a_cache_that_is_a_link_is_refused(fresh_cache: Path, tmp_path: Path) -> None:
    (tmp_path / "elsewhere").mkdir(mode=0o700)
    fresh_cache.symlink_to(tmp_path / "elsewhere")
    with pytest.raises(ToolError, match=r"is a link.*set XDG_CACHE_HOME"):
        shared_library(ANSWER, ["answer.c"], [])
    fresh_cache.unlink()
    fresh_cache.symlink_to(tmp_path / "nowhere")
    with pytest.raises(ToolError, match="is a link"):
        cache_folder()


def test_a_cache_that_is_a_file_is_refused(fresh_cache: Path) -> None:
    fresh_cache.write_text("")
    with pytest.raises(ToolError, match=r"firmloop is no folder: .*set XDG_CACHE_HOME"):
        cache_folder()


@pytest.mark.parametrize("linked", [False, True])
def test_a_cache_below_a_folder_open_to_all_is_refused(
    linked: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whoever can write a folder above can put another one in its place, but not where it is sticky, as /tmp is."""
    wide = tmp_path / "wide"
    wide.mkdir()
    if linked:
        (tmp_path / "home").symlink_to(wide)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "home" if linked else wide / "inner"))
    wide.chmod(0o777)
    with pytest.raises(ToolError, match="wide can be written by everybody"):
        cache_folder()
    wide.chmod(0o1777)
    assert cache_folder().stat().st_mode & 0o777 == 0o700
    wide.chmod(0o755)
    assert cache_folder().is_dir()


def test_a_link_above_that_turns_in_a_circle_ends(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "one").symlink_to(tmp_path / "two")
    (tmp_path / "two").symlink_to(tmp_path / "one")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "one"))
    with pytest.raises(ToolError, match="set XDG_CACHE_HOME"):
        cache_folder()


@pytest.mark.skipif(os.getuid() != 0, reason="only root can give a folder to another user")
@pytest.mark.parametrize("above", [False, True])
def test_a_cache_of_another_user_is_refused(above: bool, fresh_cache: Path) -> None:
    fresh_cache.mkdir(mode=0o700)
    os.chown(fresh_cache.parent if above else fresh_cache, 12345, 12345)
    with pytest.raises(ToolError, match="belongs to another user"):
        cache_folder()


def test_a_cache_that_is_not_absolute_is_none(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_CACHE_HOME", "here")
    assert not cache_folder().is_relative_to(tmp_path) and not (tmp_path / "here").exists()


def test_a_cache_under_a_careless_umask_is_still_private(fresh_cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(fresh_cache / "a" / "b"))
    before = os.umask(0)
    try:
        made = cache_folder()
    finally:
        os.umask(before)
    for folder in (made, made.parent, made.parent.parent):
        assert folder.stat().st_mode & 0o777 == 0o700


@pytest.mark.parametrize("left", [0, 100, None])
def test_a_damaged_library_is_built_again(left: int | None, fresh_cache: Path) -> None:
    """Cut short, emptied, or another in its place: to load it would end the process, or run another's code."""
    first = shared_library(ANSWER, ["answer.c"], ["-O1"])
    sound = first.read_bytes()
    other = shared_library({**ANSWER, "answer.h": "#define ANSWER 7\n"}, ["answer.c"], ["-O1"])
    damaged = other.read_bytes() if left is None else sound[:left]
    first.unlink()
    first.write_bytes(damaged)
    again = shared_library(ANSWER, ["answer.c"], ["-O1"])
    assert again.read_bytes() == sound
    assert ctypes.CDLL(str(again)).answer() == 42


def test_libraries_not_used_for_longest_make_room(fresh_cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    old, new = (shared_library(ANSWER, ["answer.c"], [level]) for level in ("-O1", "-O2"))
    monkeypatch.setattr(library_cache, "MOST_BYTES", new.stat().st_size + 1)
    os.utime(old, (time.time() - 2 * library_cache.IN_USE,) * 2)
    third = shared_library(ANSWER, ["answer.c"], ["-O0"])
    assert not old.exists() and new.exists() and third.exists(), "one that another run may be about to load stays"


def test_what_a_killed_build_left_is_swept_and_what_a_living_one_holds_is_not(fresh_cache: Path) -> None:
    held = make_scratch(cache_folder(), "build", 0o700)
    left = fresh_cache / "build.0123abcd"
    (left / "inner").mkdir(parents=True)
    shared_library(ANSWER, ["answer.c"], ["-O1"])
    assert held.path.is_dir() and not left.exists()
    held.remove()
    assert [path.suffix for path in fresh_cache.iterdir()] == [".so"]


@pytest.mark.parametrize("kind", ["folder", "pipe", "link to nothing", "link to another"])
def test_what_is_no_file_in_the_place_of_a_library_makes_room_for_it(kind: str, fresh_cache: Path) -> None:
    first = shared_library(ANSWER, ["answer.c"], ["-O1"])
    sound = first.read_bytes()
    first.unlink()
    if kind == "folder":
        (first / "inner").mkdir(parents=True)
    elif kind == "pipe":
        os.mkfifo(first)
    else:
        (fresh_cache / "other").write_bytes(sound)
        first.symlink_to(fresh_cache / ("other" if kind == "link to another" else "nothing"))
    again = shared_library(ANSWER, ["answer.c"], ["-O1"])
    assert again.is_file() and not again.is_symlink() and again.read_bytes() == sound


def test_a_library_without_its_rights_is_built_again(fresh_cache: Path) -> None:
    shared_library(ANSWER, ["answer.c"], ["-O1"]).chmod(0)
    again = shared_library(ANSWER, ["answer.c"], ["-O1"])
    assert os.access(again, os.R_OK | os.X_OK) and ctypes.CDLL(str(again)).answer() == 42


def test_what_a_killed_compiler_leaves_is_in_the_folder_that_is_swept(
    fresh_cache: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    tools = tmp_path / "tools"
    tools.mkdir()
    (tools / "gcc").write_text(
        '#!/bin/sh\n[ "$1" = --version ] && echo gcc 1 && exit\ntouch "$TMPDIR/cc.s"\nkill -9 $$\n'
    )
    (tools / "gcc").chmod(0o755)
    for place in (tmp_path, Path.cwd()):
        assert not (place / "cc.s").exists()
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setenv("PATH", f"{tools}:{os.environ['PATH']}")
    with pytest.raises(ToolError):
        shared_library({"answer.c": "int answer(void);\n"}, ["answer.c"], ["-O1"])
    assert not (tmp_path / "cc.s").exists() and list(fresh_cache.iterdir()) == []

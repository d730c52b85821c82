"""The host compiler's cache and its errors."""

from __future__ import annotations

import ctypes
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from identify.compiler import ToolError, cache_folder, find_tool, run_compiler, shared_library

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

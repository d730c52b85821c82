"""Names that C, its headers or a build's files are refused before any C is written; all others build as they lie."""

import re
import subprocess
from pathlib import Path

import pytest

from firmloop.cli import main
from firmloop.codegen.bundle import CodegenError
from firmloop.codegen.environment import text_of
from firmloop.codegen.names import ENDS, HEADERS, check_identifier

ROOT = Path(__file__).parents[2]
PROJECT = """\
schema = 1
name = "NAME"
[controller]
kind = "pid"
period_s = 0.001
kp = 0.05
ki = 1.0
[signals]
reference = { unit = "rad/s", low = -400, high = 400 }
measurement = { unit = "rad/s", low = -400, high = 400 }
output = { unit = "V", low = -12, high = 12 }
[arithmetic]
number = "fixed"
bits = 32
[target]
names = ["host"]
"""
C_HEADERS = """
    assert complex ctype errno fenv float inttypes iso646 limits locale math setjmp signal stdalign stdarg stdatomic
    stdbit stdbool stdckdint stddef stdint stdio stdlib stdnoreturn string tgmath threads time uchar wchar wctype
""".split()
TAKEN = {
    "stdint": "<stdint.h>",
    "string": "<string.h>",
    "math": "<math.h>",
    "signal": "<signal.h>",
    "int32": "int32_t",
    "int_fast8": "C",
    "uint": "C",
    "size": "size_t",
    "time": "time_t",
    "div": "div_t",
    "clock": "clock_t",
    "pid": "pid_t",
    "mode": "mode_t",
    "mtx": "mtx_t",
    "atomic_size": "atomic_size_t",
    "host": "host.c",
    "fmi3": "fmi3.c",
    "con": "Windows",
    "com1": "Windows",
    "sched": "<sched.h>",
    "pthread": "<pthread.h>",
    "arduino": "<arduino.h>",
}


@pytest.mark.parametrize("name", TAKEN)
@pytest.mark.parametrize("verb", ["generate", "verify"])
def test_a_project_of_a_taken_name_is_refused(
    verb: str, name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "p.toml"
    file.write_text(PROJECT.replace("NAME", name))
    assert main([verb, str(file), "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    assert f"project name '{name}' is taken by " in said and TAKEN[name] in said and "choose another name" in said
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("name", ["model", "run", "sample", "records", "read", "intake", "speed", "timer", "test"])
def test_a_project_of_any_other_name_builds(name: str, tmp_path: Path) -> None:
    (tmp_path / "p.toml").write_text(PROJECT.replace("NAME", name))
    assert main(["verify", str(tmp_path / "p.toml"), "--out", str(tmp_path / "out"), "--steps", "100"]) == 0
    made = subprocess.run(["make", "check"], cwd=tmp_path / "out" / name, capture_output=True, text=True)
    assert made.returncode == 0, made.stderr


def refused(name: str) -> bool:
    try:
        check_identifier(name, "project name")
    except CodegenError:
        return True
    return False


def test_no_type_of_a_header_of_c_can_be_made_of_a_name(tmp_path: Path) -> None:
    includes = "".join(f"#if __has_include(<{name}.h>)\n#include <{name}.h>\n#endif\n" for name in C_HEADERS)
    (tmp_path / "all.c").write_text(includes)
    text = subprocess.run(["gcc", "-std=c99", "-E", "all.c"], cwd=tmp_path, capture_output=True, text=True).stdout
    stems = set(re.findall(rf"\b([a-z][a-z0-9]*(?:_[a-z0-9]+)*?)(?:{'|'.join(ENDS)})\b", text))
    assert len(stems) > 40 and sorted(stem for stem in stems if not refused(stem)) == []
    assert set(C_HEADERS) <= HEADERS | {"float"}


def test_no_file_that_includes_a_controller_defines_what_can_be_made_of_a_name() -> None:
    """Names of ours at file scope begin with fl_, which no project's may."""
    found = [file for file in (ROOT / "templates_c").rglob("*.j2") if "{{ name }}_t" in file.read_text()]
    found += [ROOT / "templates_c" / name for name in ("main.c.j2", "live.c.j2", "live.h.j2", "fmu/access.c.j2")]
    assert len(found) > 7
    for file in found:
        defined = re.findall(rf"(?<![\w}}])([a-z]\w*)(?:{'|'.join(ENDS)})\b", file.read_text())
        assert [name for name in defined if not refused(name)] == [], file.name
    assert "LIVE_H" not in re.findall(r"#ifndef (\w+)", text_of("live.h.j2"))


@pytest.mark.parametrize("name", ["complex", "noreturn", "stdin", "i386", "char16_t"])
def test_a_signal_is_no_macro_of_a_header(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "p.toml").write_text(PROJECT.replace("NAME", "wheel").replace("output =", f"{name} ="))
    assert main(["generate", str(tmp_path / "p.toml"), "--out", str(tmp_path / "out")]) == 2
    assert f"signal '{name}' is taken by C, C++ or the generated code" in capsys.readouterr().err

"""Nothing that a stranger's project, target, recording or device says runs a command or reaches a terminal raw."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections import namedtuple
from pathlib import Path

import pytest
from serial.tools import list_ports

from firmloop.cli import main
from firmloop.codegen.target import load_target, target_names
from firmloop.console import visible

ROOT = Path(__file__).parents[3]
PROJECT = """\
schema = 1
name = "tank"
[controller]
kind = "pid"
period_s = 0.001
kp = 0.05
ki = 0.4
[signals]
reference = { unit = "degC", low = -400, high = 400 }
measurement = { unit = "degC", low = -400, high = 400 }
output = { unit = "V", low = -12, high = 12 }
[arithmetic]
number = "fixed"
bits = 32
[target]
names = ["mine.toml"]
"""
MCPU = '"-mcpu=cortex-m4"'
SPECS = "*evil:\ntouch ./RAN %i\n\n.c:\n@evil\n"
FLAGS = """
-specs=evil.c --specs=evil.c -Bboard -B. -B/tmp -wrapper -wrapper,touch,RAN -fplugin=./evil.so -fplugin-arg-evil-run=RAN
-Wl,-plugin,./evil.so -Wl,--plugin=./evil.so -Wa,-I. -Wp,-MD,RAN -Xlinker -Xassembler -Xpreprocessor -T/tmp/link.ld
@evil.c -I/etc -I. -isystem/etc -iquote. -include -imacros -x -xassembler -xlto -o -oRAN -c -S -save-temps -dumpdir
-fdump-tree-all=RAN -fuse-ld=./evil -flto -flto-partition=none -fprofile-use=RAN -fauto-profile=RAN -MD -MFRAN
-fstack-usage -fmodules-ts -fmodule-mapper=|touch -print-file-name=RAN --sysroot=. -idirafter. -iplugindir=. -nostdinc
-ffast-math -Ofast -fcompare-debug=RAN -fdiagnostics-format=sarif-file -DEVIL -march=../evil -mcpu=cortex-m4,@evil.c
-mcpu=$(touch${IFS}RAN) -mthumb;touch -mthumb\\nRAN -mfpu=@evil.c -O2\\u001b --param=evil -no-canonical-prefixes --help
""".split()
COMPILERS = (
    "./evil", "evil", "/bin/sh", "sh", "touch", "env", "../evil", "gcc -specs=evil.c", "ccache", "arm-none-eabi-gcc;sh",
    "arm-none-eabi-g++", "-gcc", "", "ARM-NONE-EABI-GCC", "python3", "make",
)  # fmt: skip
SOURCES = (
    "-specs=evil.c", "-wrapper.c", "@evil.c", "../evil.c", "evil.s", "evil.S", 
    "evil.c.so", "evil.C", "a/evil.c", "e vil.c",
    "$(shell touch RAN).c", "evil.c\\nRAN", "link.c", "folder.c", "pipe.c", "startup_cortex_m.c", ".c", "evil.cpp",
)  # fmt: skip
CHANGES = {
    "a machine with options": ('"mps2-an386"', '"virt,dumpdtb=RAN"'),
    "a machine that is an option": ('"mps2-an386"', '"-chardev"'),
    "a region that is a script": ('name = "ram"', 'name = "ram : ORIGIN = 0 } INCLUDE evil.c"'),
    "a region that is an expression": ('name = "ram"', 'name = "r-am"'),
    "a name that is a path": ('name = "mine"', 'name = "../mine"'),
    "a comment that ends": ("Cortex-M4F at 25 MHz", "*/ int evil; /*"),
    "a startup that is a path": ('"cortex_m"', '"../evil"'),
    "a driver that is a path": ('driver = "cmsdk"\nbase = 0x4000_4000', 'driver = "../evil"\nbase = 0x4000_4000'),
    "a core that is an option": ('"cortex-m4"\n', '"-specs=evil.c"\n'),
    "a probe that is an option": ("[timer]", '[flash]\npyocd = "--script=evil.py"\n[timer]'),
    "a script outside of OpenOCD": ("[timer]", '[flash]\nopenocd = ["board/../../evil.cfg"]\n[timer]'),
    "a script by its path": ("[timer]", '[flash]\nopenocd = ["/tmp/evil.cfg"]\n[timer]'),
    "a script that is a command": ("[timer]", '[flash]\nopenocd = ["a.cfg; exec touch RAN"]\n[timer]'),
    "own code beside the host's files": ('tested = "run"', 'tested = "run"\nsources = ["evil.c"]'),
    "own registers beside the host's files": ("[timer]", '[[setup]]\naddress = 0x2000_0000\nsays = "x"\n[timer]'),
}


def mine(old: str, new: str) -> str:
    """The text of a sound target, changed."""
    text = (ROOT / "targets" / "qemu_mps2_an386.toml").read_text().replace('"qemu_mps2_an386"', '"mine"')
    assert text.count(old) == 1
    return text.replace(old, new)


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A stranger's folder, which the user stands in."""
    folder = tmp_path / "project"
    folder.mkdir()
    (folder / "p.toml").write_text(PROJECT)
    for place in (folder, tmp_path):
        (place / "evil.c").write_text(SPECS)
    (folder / "link.c").symlink_to(tmp_path / "evil.c")
    (folder / "folder.c").mkdir()
    os.mkfifo(folder / "pipe.c")
    (folder / "evil").write_text(f"#!/bin/sh\ntouch {tmp_path}/RAN\n")
    (folder / "evil").chmod(0o755)
    monkeypatch.setenv("PATH", f"{folder}:{os.environ['PATH']}")
    monkeypatch.chdir(folder)
    return folder


def refused(here: Path, text: str, capsys: pytest.CaptureFixture[str]) -> str:
    """Refused by name in one line, and nothing ran."""
    (here / "mine.toml").write_text(text)
    assert main(["verify", "p.toml", "--out", "out", "--steps", "50"]) == 2
    said = capsys.readouterr()
    assert said.out == "" and len(said.err.splitlines()) == 1 and "mine.toml: " in said.err, said.err
    assert not list(here.parent.rglob("RAN")) and not (here / "out").exists()
    return said.err


@pytest.mark.parametrize("flag", FLAGS)
def test_a_flag_runs_nothing(flag: str, here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    said = refused(here, mine(MCPU, f'"{flag}", {MCPU}'), capsys)
    assert "flags = " in said and "is not a plain compiler flag" in said and "-mcpu=" in said


@pytest.mark.parametrize("compiler", COMPILERS)
def test_a_compiler_is_one_of_a_list(compiler: str, here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    said = refused(here, mine('"arm-none-eabi-gcc"', f'"{compiler}"'), capsys)
    assert "compiler = " in said and "known: gcc, arm-none-eabi-gcc" in said


@pytest.mark.parametrize("source", SOURCES)
def test_a_source_is_a_c_file_of_the_folder(source: str, here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = mine('["semihosting", "uart"]', f'["uart"]\nsources = ["{source}"]')
    assert "sources = " in refused(here, text, capsys)


@pytest.mark.parametrize("change", CHANGES)
def test_no_other_text_of_a_target_runs_anything(change: str, here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    refused(here, mine(*CHANGES[change]), capsys)


@pytest.mark.cross
@pytest.mark.qemu
def test_what_targets_need_is_still_allowed(here: Path) -> None:
    flags = '"-O1", "-mtune=cortex-m4", "-fno-tree-vectorize", "-mslow-flash-data", "-mcpu=cortex-m4+nofp"'
    (here / "mine.toml").write_text(mine(f"flags = [{MCPU}", f"flags = [{flags}").replace("hard", "soft"))
    text = (ROOT / "targets" / "qemu_mps2_an386.toml").read_text()
    assert "hard" in text
    assert main(["verify", "p.toml", "--out", "out", "--steps", "50"]) == 0


def test_every_target_that_comes_along_obeys() -> None:
    assert [load_target(name).name for name in target_names()] == list(target_names())


@pytest.mark.cross
@pytest.mark.parametrize("name", ["-wrapper,touch,RAN.c", "$(shell touch RAN).c", "a b.c", "@evil.c"])
def test_a_file_to_run_live_is_no_option(name: str, here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (here / name).write_text("int evil;\n")
    (here / "p.toml").write_text(PROJECT.replace("mine.toml", "nucleo_f411re"))
    assert main(["flash", "p.toml", "--target", "nucleo_f411re", f"--live={name}", "--out", "out"]) == 2
    assert "rename it" in capsys.readouterr().err
    assert not list(here.parent.rglob("RAN"))


@pytest.mark.cross
@pytest.mark.parametrize("name", ["pyocd", "openocd"])
def test_a_probes_tool_takes_no_script_of_the_project(name: str, here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Both run what lies where they are started: pyocd_user.py, and any file called like a script of OpenOCD."""
    tools = here.parent / "tools"
    tools.mkdir()
    (tools / name).write_text("#!/bin/sh\nfor f in pyocd_user.py board/*.cfg; do [ -e $f ] && sh $f; done\nexit 0\n")
    (tools / name).chmod(0o755)
    monkeypatch.setenv("PATH", f"{tools}:/usr/bin:/bin")
    (here / "board").mkdir()
    for script in ("pyocd_user.py", "board/stm32f4discovery.cfg"):
        (here / script).write_text(f"touch {here.parent}/RAN\n")
    (here / "p.toml").write_text(PROJECT.replace("mine.toml", "stm32f4_discovery"))
    command = ["flash", "p.toml", "--target", "stm32f4_discovery"]
    assert main([*command, "--out", "out"]) == 0
    assert main([*command, "--out", "x} ; exec touch RAN ; {"]) == (3 if name == "openocd" else 0)
    assert not list(here.parent.rglob("RAN"))


def test_no_module_is_taken_from_the_projects_folder(here: Path) -> None:
    for module in ("argparse", "numpy", "pathlib", "identify", "casadi"):
        (here / f"{module}.py").write_text("open('RAN', 'w')\nraise SystemExit(f'{__name__} was imported')\n")
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-m", "firmloop", "generate", "p.toml", "--out", "out"]
    (here / "p.toml").write_text(PROJECT.replace("mine.toml", "host"))
    done = subprocess.run(command, cwd=here, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert not (here / "RAN").exists()


@pytest.mark.parametrize("part", ["", ".", "./", "../project", "tools"])
def test_no_tool_is_taken_from_the_projects_folder(part: str, here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A part of PATH that is empty or relative, as `PATH=$PATH:` leaves one, leads into the folder one stands in."""
    (here / "tools").mkdir()
    for name in ("gcc", "cppcheck", "qemu-system-arm", "arm-none-eabi-gcc", "setpriv"):
        for tool in (here / name, here / "tools" / name):
            tool.write_text(f"#!/bin/sh\ntouch {here.parent}/RAN\n")
            tool.chmod(0o755)
    monkeypatch.setenv("PATH", f"{part}:/usr/bin:/bin")
    (here / "p.toml").write_text(PROJECT.replace("mine.toml", "host"))
    for words in (["verify", "p.toml", "--out", "out", "--steps", "50"], ["doctor"]):
        assert main(words) in (0, 3)
    assert not list(here.parent.rglob("RAN"))


HIDDEN = "\x1b]0;evil\x07\x1b[2J\x85\u2028\u2029\u202e\u2066\x7f\x9b\x08\r"


def plain(text: str) -> bool:
    return all(c.isprintable() or c == "\n" for c in text)


@pytest.mark.parametrize("where", ["key", "table", "value", "name", "path", "signal", "target", "recording", "column"])
@pytest.mark.parametrize("form", [(), ("--json",)])
def test_no_control_character_reaches_a_terminal(
    where: str, form: tuple[str, ...], here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    toml = json.dumps(HIDDEN).replace("\x7f", "\\u007f")
    path, verb = "p.toml", "verify"
    text = PROJECT.replace("mine.toml", "host")
    if where == "path":
        path = f"{HIDDEN}\n.toml"
        text = text.replace("kp = 0.05", "kp = [")
    recorded = '[plant]\nkind = "first_order"\ninput = "voltage_V"\noutputs = ["speed_rad_s"]\n[controller]\n'
    if where in ("recording", "column"):
        verb = "identify"
        file = toml if where == "recording" else '"c.csv"'
        text = text.replace("[controller]\n", f"[recordings]\ntrain = [{file}]\n{recorded}")
        (here / "c.csv").write_text(f"time_s,{HIDDEN.rstrip()}x\n0,1\n1,2\n2,3\n", encoding="utf-8", newline="")
    old, new = {
        "key": ("kp = 0.05", f"{toml} = 0.05"),
        "table": ("[arithmetic]", f"[{toml}]\n[arithmetic]"),
        "value": ('"pid"', toml),
        "name": ('"tank"', toml),
        "signal": ("reference =", f"{toml} ="),
        "target": ('"host"', toml),
    }.get(where, ("", ""))
    (here / path).write_text(text.replace(old, new) if old else text, encoding="utf-8")
    assert main([verb, path, "--out", "out", *form]) == 2
    said = capsys.readouterr()
    assert plain(said.err) and plain(said.out), ascii(said)
    assert len(said.err.splitlines()) == 1


def test_what_a_device_calls_itself_is_shown_plain(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    info = namedtuple("info", "device vid pid manufacturer product serial_number description")
    monkeypatch.setattr(list_ports, "comports", lambda: [info("/dev/ttyACM0", 1, 2, HIDDEN, HIDDEN, HIDDEN, HIDDEN)])
    for form in ([], ["--json"]):
        assert main(["targets", "--ports", *form]) == 0
        said = capsys.readouterr()
        assert "/dev/ttyACM0" in said.out and plain(said.out) and said.err == ""


def test_words_in_any_language_stay_as_they_are() -> None:
    for text in ("Ångström µ Ω °C ≤ 電圧", "two\nlines\tand a tab"):
        assert visible(text) == text
    assert visible("\u200b\u202ea\udc80") == "\\u200b\\u202ea\\udc80"

"""Targets: what comes with firmloop is sound, and a wrong file gets one sentence that says what is wrong with it."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest

from firmloop.codegen.bundle import CodegenError
from firmloop.codegen.firmware import firmware
from firmloop.codegen.target import RegisterWrite, Target, load_target, parse_target, target_names
from tests.verify.tiny import tiny

GOOD = """\
name = "mine"
says = "a board of mine"
core = "cortex-m3"
compiler = "arm-none-eabi-gcc"
flags = ["-mcpu=cortex-m3", "-mthumb"]
float_units = []
clock_hz = 25_000_000
stack_bytes = 1024
startup = "cortex_m"
links = ["uart"]
tested = "built"
memory = [{ name = "flash", start = 0, bytes = 262144 }, { name = "ram", start = 0x2000_0000, bytes = 8192 }]
uart = { driver = "cmsdk", base = 0x4000_4000, baud = 115_200 }
timer = { driver = "cmsdk", base = 0x4000_0000, bits = 32 }
setup = [{ address = 0x4002_3830, set = 0x1, says = "clock of port A" }]
"""


def changed(old: str, new: str) -> str:
    assert old in GOOD
    return GOOD.replace(old, new)


@pytest.mark.parametrize("name", target_names())
def test_every_target_is_sound(name: str) -> None:
    assert load_target(name).name == name


def test_a_target_file_of_the_user_is_read(tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text(GOOD)
    target = load_target(str(tmp_path / "mine.toml"))
    assert target.qemu is None
    assert target.uart is not None and target.uart.clock_hz == 25_000_000
    assert target.setup == (RegisterWrite(0x40023830, 0, 1, "clock of port A"),)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("name = ", "mine.toml: not TOML"),
        (changed('name = "mine"', ""), "mine.toml: name is missing"),
        (changed('"mine"', '"yours"'), "mine.toml: name = 'yours': must be the name of its file, 'mine'"),
        (changed('"mine"', "7"), "name = 7: must be letters"),
        (changed('"a board of mine"', '"*/ int x; /*"'), "says = .* must be a line of ASCII, at most 100 char"),
        (changed('"-mthumb"', '"-mthumb; rm -rf /"'), "flags = '-mthumb; rm -rf /': is not a plain compiler flag"),
        (changed("25_000_000", "-1"), "clock_hz = -1: must be a whole number from 1 to"),
        (changed("25_000_000", "true"), "clock_hz = True: must be a whole number"),
        (changed('["uart"]', '["usb"]'), "links = 'usb': is unknown; known: library, semihosting, uart"),
        (changed('["uart"]', "[]"), "links = .*names at least one link"),
        (changed('["uart"]', '["uart", "uart"]'), "links = .*names something twice"),
        (changed('["uart"]', '["uart", "library"]'), "links = .*'library'. alone on a host"),
        (changed('["uart"]', '["semihosting"]'), "mine.toml: qemu is missing"),
        (changed('"cortex_m"', '"cortex_a"'), "startup = 'cortex_a': is unknown; known: cortex_m"),
        (
            changed('driver = "cmsdk", base = 0x4000_4000', 'driver = "8250", base = 0x4000_4000'),
            "uart.driver = '8250'",
        ),
        (changed("baud", "boud"), "uart.baud is missing"),
        (changed("115_200", "115_200, interrupt = 480"), "uart.interrupt = 480: must be a whole number from 0 to 479"),
        (
            changed('"cmsdk", base = 0x4000_4000', '"pl011", interrupt = 5, base = 0x4000_4000'),
            "uart.interrupt = 5: is of no use to driver 'pl011', which asks for bytes again and again: leave it out",
        ),
        (changed("bits = 32", "bits = 32, width = 3"), "timer.width = 3: is an unknown key; known: driver, base, bits"),
        (changed("bytes = 8192", "bytes = 1024"), "stack_bytes = 1024: is a multiple of 8 and smaller than .*'ram'"),
        *(
            (changed("stack_bytes = 1024", f"stack_bytes = {odd}"), f"stack_bytes = {odd}: is a multiple of 8")
            for odd in (1023, 1020, 1025, 1028)
        ),
        (changed('"ram"', '"sram"'), "memory = .*names 'flash' and 'ram', each once"),
        (
            changed('[{ name = "flash"', '[3, { name = "flash"'),
            r"memory = .*must be a list of tables, written \[\[memory",
        ),
        (changed("set = 0x1", "set = 0x1_0000_0000"), r"setup\[1\].set = 4294967296: must be a whole number"),
        (changed('"built"', '"maybe"'), "tested = 'maybe': is unknown; known: run, built"),
        (GOOD + 'boot = "rp2350"\n', "boot = 'rp2350': is unknown; known: rp2040"),
        (GOOD + 'usb = ["0483-374b"]\n', "usb = '0483-374b': is not vendor:product"),
        (GOOD + 'usb = "0483:374b"\n', "usb = '0483:374b': must be a list of texts"),
        (GOOD + 'sources = ["gone.c"]\n', "sources = 'gone.c': cannot be read"),
        (GOOD + 'sources = ["../mine.c"]\n', "sources = '../mine.c': is not a file's name"),
        (GOOD + 'sources = ["a/mine.c"]\n', "sources = 'a/mine.c': names a .c file in the folder"),
        (GOOD + 'flash = { drag = "exe" }\n', "flash.drag = 'exe': is unknown; known: bin, hex, uf2"),
        (GOOD + 'flash = { openocd = ["a; b"] }\n', "flash.openocd = 'a; b': is not a file's name"),
        (GOOD + 'flash = { avrdude = "m328" }\n', "flash.avrdude = 'm328': is an unknown key; known: pyocd"),
        (changed("set = 0x1", "wait = -1"), r"setup\[1\].wait = -1: must be a whole number"),
        (GOOD + "colour = 3\n", "colour = 3: is an unknown key; known: .*links"),
    ],
)
def test_a_wrong_target_file_is_refused(text: str, says: str, tmp_path: Path) -> None:
    with pytest.raises(CodegenError, match=says) as caught:
        parse_target(text, "mine.toml", tmp_path)
    assert str(caught.value).startswith("mine.toml: ")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["no_such", "no_such.toml", "../host"])
def test_an_unknown_target_is_refused_by_its_name(name: str) -> None:
    with pytest.raises(CodegenError, match=re.escape(name)):
        load_target(name)


def small_target() -> Target:
    return parse_target(GOOD, "mine.toml", Path())


def test_firmware_is_the_same_twice() -> None:
    program, bundle = tiny(2.0)
    target = load_target("qemu_mps2_an386")
    assert firmware(program, bundle, target, "uart") == firmware(program, bundle, target, "uart")


def test_firmware_holds_the_controller_unchanged() -> None:
    program, bundle = tiny(2.0)
    files = firmware(program, bundle, small_target(), "uart")
    assert {name: files[f"controller/{name}"] for name in bundle.files} == dict(bundle.files)
    assert "{0x40023830U, 0x00000000U, 0x00000001U, 0x00000000U}, /* clock of port A */" in files["board/setup.c"]
    assert "LENGTH = 8192" in files["link.ld"]


def test_a_transport_that_the_target_does_not_have_is_refused() -> None:
    program, bundle = tiny(2.0)
    for transport in ("semihosting", "library", "usb"):
        with pytest.raises(CodegenError, match=f"target mine has no link '{transport}' for an image; it has: uart"):
            firmware(program, bundle, small_target(), transport)


def test_frames_are_as_long_as_a_small_memory_holds() -> None:
    program, bundle = tiny(2.0)
    wide = replace(program, inputs=program.inputs * 20)
    steps = re.search(r"#define STEPS_MAX (\d+)U", firmware(wide, bundle, small_target(), "uart")["main.c"])
    assert steps and int(steps.group(1)) == (8192 // 4 - 256) // (160 + 4 + 8)
    with pytest.raises(CodegenError, match="a quarter of its 8192 bytes of RAM cannot hold one step of tiny"):
        firmware(replace(program, inputs=program.inputs * 500), bundle, small_target(), "uart")

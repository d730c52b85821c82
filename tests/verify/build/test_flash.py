"""Flashing without a board: the files to drag hold the image, and the tools are called as they want to be."""

from __future__ import annotations

import struct
from collections import namedtuple
from pathlib import Path

import pytest
from serial.tools import list_ports

from firmloop.cli import main
from firmloop.codegen.target import load_target
from firmloop.verify.build.elf import Segment, flat, segments
from firmloop.verify.build.flash import intel_hex, uf2
from firmloop.verify.links.ports import boards_at, find_ports
from tests.verify.links.test_faults import PROJECT

IMAGE = Segment(0x0800_FFF0, bytes(range(256)) * 2 + b"end")


def read_hex(text: str) -> dict[int, int]:
    memory, upper = {}, 0
    for row in text.splitlines():
        data = bytes.fromhex(row[1:])
        assert row[0] == ":" and sum(data) & 0xFF == 0 and len(data) == data[0] + 5
        address, kind = int.from_bytes(data[1:3], "big"), data[3]
        if kind == 4:
            upper = int.from_bytes(data[4:6], "big") << 16
        for offset, byte in enumerate(data[4:-1] if kind == 0 else b""):
            memory[upper + address + offset] = byte
    assert text.endswith(":00000001FF\n")
    return memory


def test_intel_hex_holds_the_image_across_64_kb() -> None:
    assert read_hex(intel_hex(IMAGE).decode()) == {IMAGE.address + k: byte for k, byte in enumerate(IMAGE.data)}


def test_uf2_holds_the_image_in_whole_blocks() -> None:
    data = uf2(IMAGE)
    assert len(data) == 3 * 512
    memory = b""
    for number in range(3):
        block = data[512 * number : 512 * (number + 1)]
        first, second, flags, address, size, index, count, family = struct.unpack_from("<8I", block)
        assert (first, second, block[-4:]) == (0x0A324655, 0x9E5D5157, b"\x30\x6f\xb1\x0a")
        assert (flags, size, index, count, family) == (0x2000, 256, number, 3, 0xE48BFF56)
        assert address == IMAGE.address + 256 * number
        memory += block[32 : 32 + size]
    assert memory.rstrip(b"\0") == IMAGE.data


@pytest.fixture
def project(tmp_path: Path) -> Path:
    (tmp_path / "wheel.toml").write_text(PROJECT)
    return tmp_path / "wheel.toml"


def tool(folder: Path, name: str, status: int) -> None:
    folder.mkdir(exist_ok=True)
    (folder / name).write_text(f'#!/bin/sh\necho "$@" > {folder}/called\necho no probe is connected\nexit {status}\n')
    (folder / name).chmod(0o755)


@pytest.mark.cross
@pytest.mark.parametrize(("target", "ending"), [("nucleo_f411re", "bin"), ("raspberry_pi_pico", "uf2")])
def test_without_a_tool_there_is_the_file_to_drag(
    project: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], target: str, ending: str
) -> None:
    out = tmp_path / "out"
    assert main(["flash", str(project), "--target", target, "--out", str(out)]) == 0
    assert f"NOT flashed: drag {out}/image.{ending} onto the board's drive" in capsys.readouterr().out
    image = flat(segments(out / "image.elf"))
    written = (out / f"image.{ending}").read_bytes()
    assert written == (image.data if ending == "bin" else uf2(image))
    assert not list(out.rglob("*.o"))


@pytest.mark.cross
def test_tools_are_called_and_their_failure_is_status_3(
    project: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    out, tools = tmp_path / "out", tmp_path / "tools"
    command = ["flash", str(project), "--target", "stm32f4_discovery", "--out", str(out)]
    assert main(command) == 3
    assert "stm32f4_discovery has no drive" in capsys.readouterr().err
    monkeypatch.setenv("PATH", f"{tools}:/usr/bin:/bin")
    tool(tools, "openocd", 0)
    assert main(command) == 0
    assert "flashed with openocd" in capsys.readouterr().out
    called = (tools / "called").read_text()
    assert called == f"-f board/stm32f4discovery.cfg -c program {{{out}/image.elf}} verify reset exit\n"
    tool(tools, "pyocd", 1)
    assert main(command) == 3
    assert "no probe is connected" in capsys.readouterr().err
    assert (tools / "called").read_text() == f"flash --target stm32f407vgtx {out}/image.elf\n"


def test_what_is_no_board_is_not_flashed(project: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name in ("host", "qemu_microbit"):
        assert main(["flash", str(project), "--target", name, "--out", str(tmp_path / "out")]) == 2
        assert f"target {name} is no board" in capsys.readouterr().err


def test_ports_are_told_with_the_boards_they_may_belong_to(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    info = namedtuple("info", "device vid pid manufacturer product serial_number description")
    there = [
        info("/dev/ttyACM0", 0x0483, 0x374B, "STMicroelectronics", "STM32 STLink", "0667", "STM32 STLink"),
        info("/dev/ttyS0", None, None, None, None, None, "n/a"),
    ]
    monkeypatch.setattr(list_ports, "comports", lambda: there)
    port = find_ports()[0]
    assert (port.device, port.usb, port.says) == ("/dev/ttyACM0", "0483:374b", "STMicroelectronics STM32 STLink 0667")
    assert boards_at(port, [load_target("nucleo_f411re"), load_target("nrf52840_dk")]) == ("nucleo_f411re",)
    assert main(["targets", "--ports"]) == 0
    said = capsys.readouterr().out
    assert "/dev/ttyACM0  0483:374b" in said and "nucleo_f401re" in said and "/dev/ttyS0" in said

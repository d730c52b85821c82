"""Real boards are not here, but what can be known without one is: the image, its start, its size, its drivers."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from firmloop.codegen.emit import emit
from firmloop.codegen.firmware import firmware
from firmloop.codegen.target import MemoryRegion, Qemu, Target, Timer, Uart, load_target, target_names
from firmloop.identify.simulation.compiler import ToolError
from firmloop.quantize.lower.lower import lower
from firmloop.verify.build.elf import flat, segments
from firmloop.verify.build.image import build_image
from firmloop.verify.build.start import boot_crc, check_start
from firmloop.verify.links.uart import open_qemu_uart
from tests.laws import FULL, pid
from tests.verify.boards import BUNDLE, PROGRAM, RESULT, expected, packed

pytestmark = pytest.mark.cross

BUILT = [name for name in target_names() if load_target(name).tested == "built"]


def test_every_family_is_there() -> None:
    assert {load_target(name).uart.driver for name in BUILT} == {"stm32_v1", "stm32_v2", "nrf", "pl011", "user"}


@pytest.mark.parametrize("name", BUILT)
def test_a_board_s_image_can_start_and_fits(name: str, tmp_path: Path) -> None:
    """Built with every warning an error; build_image() checks vectors and stack, which is checked once more here."""
    target = load_target(name)
    law = pid(FULL)
    program = lower(law, "fixed32")
    image = build_image(firmware(program, emit(program, "test"), target, "uart"), target, tmp_path)
    check_start(image.elf, target)
    ram = next(region for region in target.memory if region.name == "ram")
    memory = flat(segments(image.elf))
    stack = int.from_bytes(memory.data[256 if target.boot else 0 :][:4], "little")
    assert stack == ram.start + target.stack_bytes
    assert image.whole.text_bytes < 8_192
    assert image.whole.bss_bytes + image.whole.data_bytes < ram.size * 0.7
    assert image.double_helpers == ()


def test_a_start_that_cannot_be_is_refused(tmp_path: Path) -> None:
    target = load_target("nucleo_f401re")
    image = build_image(firmware(PROGRAM, BUNDLE, target, "uart"), target, tmp_path)
    elsewhere = replace(target, memory=(target.memory[0], MemoryRegion("ram", 0x2400_0000, 8192)))
    with pytest.raises(ToolError, match=r"nucleo_f401re: the initial stack pointer 0x2000.* is not in the RAM"):
        check_start(image.elf, elsewhere)
    whole, loaded = image.elf.read_bytes(), flat(segments(image.elf)).data
    at = whole.index(loaded[:64])
    for odd in (1, 2, 4):
        pointer = int.from_bytes(loaded[:4], "little") - odd
        (tmp_path / "odd.elf").write_bytes(whole[:at] + pointer.to_bytes(4, "little") + whole[at + 4 :])
        with pytest.raises(ToolError, match=rf"stack pointer {pointer:#x} is not in the RAM, or not a multiple of 8"):
            check_start(tmp_path / "odd.elf", target)
    small = replace(target, memory=(MemoryRegion("flash", 0x0800_0000, 64), target.memory[1]))
    with pytest.raises(ToolError, match="the vector table has no sound handler"):
        check_start(image.elf, small)
    with pytest.raises(ToolError, match="the second stage does not carry its CRC"):
        check_start(image.elf, replace(target, boot="rp2040"))
    image.elf.write_bytes(b"\x7fELF")
    with pytest.raises(ToolError, match=r"image\.elf is no image for a 32-bit processor"):
        check_start(image.elf, target)


@pytest.mark.parametrize("name", ["qemu_riscv32"])
def test_a_core_without_vectors_starts_with_the_first_word(name: str, tmp_path: Path) -> None:
    target = load_target(name)
    image = build_image(firmware(PROGRAM, BUNDLE, target, "uart"), target, tmp_path)
    elf = bytearray(image.elf.read_bytes())
    elf[24:28] = (int.from_bytes(elf[24:28], "little") + 4).to_bytes(4, "little")  # e_entry
    image.elf.write_bytes(elf)
    with pytest.raises(
        ToolError, match=f"{name}: the image is entered at 0x80000004, but the core starts at 0x80000000"
    ):
        check_start(image.elf, target)


def test_the_boot_crc_has_the_check_value_of_the_catalogs() -> None:
    """The check value that catalogs of CRCs give for this one, which they call CRC-32/MPEG-2."""
    assert boot_crc(b"123456789") == 0x0376E6E7


def stand_in(driver: str, machine: str, base: int) -> Target:
    """A Cortex-M machine of QEMU that has a UART of another family."""
    return replace(
        load_target("qemu_mps2_an385"),
        memory=(MemoryRegion("flash", 0, 0x4_0000), MemoryRegion("ram", 0x2000_0000, 0x1_0000)),
        stack_bytes=0x4000,
        uart=Uart(driver, base, 115_200, 12_000_000),
        timer=Timer("dwt", 0xE000_1000, 32),
        qemu=Qemu(machine, 8),
    )


@pytest.mark.qemu
@pytest.mark.parametrize(
    ("driver", "machine", "base"), [("pl011", "lm3s6965evb", 0x4000_C000), ("user", "mps2-an385", 0x4000_4000)]
)
def test_drivers_that_only_boards_use_run(driver: str, machine: str, base: int, tmp_path: Path) -> None:
    """PL011 in a machine that has one; the user's two functions over the UART of another."""
    target = stand_in(driver, machine, base)
    if driver == "user":
        target = replace(target, memory=load_target("qemu_mps2_an385").memory, sources=(("mine.c", MINE),))
    image = build_image(firmware(PROGRAM, BUNDLE, target, "uart"), target, tmp_path)
    a, b = np.random.default_rng(1).normal(size=(2, 100)).astype(np.float32)
    with open_qemu_uart(target, image.elf, PROGRAM.id) as link:
        results = np.frombuffer(link.step(packed(a, b), 100), RESULT)
    np.testing.assert_array_equal(results["sum"], expected(a, b, 0.0)[0])


MINE = """\
#include "board.h"
#include "board_config.h"
#define DATA (*(volatile uint32_t *)(BOARD_UART_BASE + 0x00U))
#define STATE (*(volatile uint32_t *)(BOARD_UART_BASE + 0x04U))
static void start(void) {
    *(volatile uint32_t *)(BOARD_UART_BASE + 0x10U) = 16U;
    *(volatile uint32_t *)(BOARD_UART_BASE + 0x08U) = 3U;
}
bool board_putc(uint8_t byte) {
    start();
    if ((STATE & 1U) != 0U) {
        return false;
    }
    DATA = byte;
    return true;
}
int board_getc(void) {
    start();
    return ((STATE & 2U) != 0U) ? (int)(DATA & 0xFFU) : -1;
}
"""


def test_the_generic_target_is_copied_by_its_user(tmp_path: Path) -> None:
    """As its file says: copy both files, rename them."""
    targets = Path(__file__).parents[3] / "targets"
    text = (targets / "generic_cortex_m.toml").read_text()
    (tmp_path / "mine.toml").write_text(text.replace("generic_cortex_m", "mine"))
    shutil.copy(targets / "generic_cortex_m.c", tmp_path / "mine.c")
    target = load_target(str(tmp_path / "mine.toml"))
    assert target.sources[0][0] == "mine.c"
    build_image(firmware(PROGRAM, BUNDLE, target, "uart"), target, tmp_path / "image")

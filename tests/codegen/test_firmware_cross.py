"""The same image sources on cores without a float unit, and on one with little memory."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from firmloop.codegen.firmware import firmware
from firmloop.codegen.target import RegisterWrite, load_target
from firmloop.verify.build.image import build_image
from tests.verify.tiny import SOURCE, tiny_bundle, tiny_program

pytestmark = pytest.mark.cross

CORES = {
    "cortex-m0": ("-mcpu=cortex-m0", "-mthumb"),
    "cortex-m3": ("-mcpu=cortex-m3", "-mthumb"),
    "cortex-m4": ("-mcpu=cortex-m4", "-mthumb", "-mfloat-abi=hard", "-mfpu=fpv4-sp-d16"),
    "cortex-m7": ("-mcpu=cortex-m7", "-mthumb", "-mfloat-abi=hard", "-mfpu=fpv5-d16"),
    "cortex-m33": ("-mcpu=cortex-m33", "-mthumb", "-mfloat-abi=hard", "-mfpu=fpv5-sp-d16"),
}


@pytest.mark.parametrize("core", CORES)
@pytest.mark.parametrize("transport", ["semihosting", "uart"])
def test_image_builds_without_a_warning(core: str, transport: str, tmp_path: Path) -> None:
    setup = (RegisterWrite(0x40004010, 0xFF, 16, "a register to set up first"),)
    target = replace(load_target("qemu_mps2_an386"), core=core, flags=CORES[core], setup=setup)
    program = tiny_program(2.0)
    image = build_image(
        firmware(program, tiny_bundle(program, SOURCE.format(gain="2.0F")), target, transport), target, tmp_path
    )
    assert 0 < image.controller.text_bytes < image.whole.text_bytes < 8192
    assert image.double_helpers == ()


@pytest.mark.parametrize("core", ["cortex-m0", "cortex-m4"])
def test_a_square_root_links_with_and_without_an_instruction(core: str, tmp_path: Path) -> None:
    target = replace(load_target("qemu_mps2_an386"), core=core, flags=CORES[core])
    program = tiny_program(2.0)
    program = replace(program, body=(replace(program.body[0], function="sqrt"),))
    source = SOURCE.replace('#include "tiny.h"', '#include "tiny.h"\nfloat sqrtf(float x);')
    source = source.format(gain="2.0F").replace("2.0F * in->b", "sqrtf(in->b)")
    image = build_image(firmware(program, tiny_bundle(program, source), target, "semihosting"), target, tmp_path)
    assert image.double_helpers == ()

"""A RISC-V reports its faults as the other cores do, and says which of its tools are missing."""

from __future__ import annotations

from pathlib import Path

import pytest

from firmloop.codegen.firmware import firmware
from firmloop.codegen.target import load_target
from firmloop.identify.simulation.compiler import ToolError
from firmloop.verify.build.image import build_image
from firmloop.verify.link import LinkError
from firmloop.verify.links.opener import openers
from firmloop.verify.links.semihosting import open_semihosting
from tests.verify.boards import BUNDLE, ONE_STEP, PROGRAM
from tests.verify.tiny import SOURCE, tiny_bundle


@pytest.mark.parametrize("link_name", ["semihosting", "uart"])
@pytest.mark.parametrize("name", ["qemu_riscv32"])
@pytest.mark.parametrize(
    ("code", "says"),
    [
        ("*(volatile uint32_t *)0xA0000000UL = 1U;", "mcause=00000007 .* mtval=a0000000 .*[0-9a-f]$"),  # no memory
        ('__asm__ volatile("unimp");', "mcause=00000002 .*[0-9a-f]$"),  # illegal instruction
        # What lies below the stack is memory, but locked.
        (
            '__asm__ volatile("la sp, stack_bottom\\n addi sp, sp, -16\\n sw zero, 0(sp)" ::: "memory");',
            "mcause=00000007 .* mtval=803ffff0 .* stack=overrun; it needs more",
        ),
    ],
)
def test_a_risc_v_reports_its_faults(tmp_path: Path, name: str, link_name: str, code: str, says: str) -> None:
    source = SOURCE.format(gain="2.0F").replace(
        "    self->total = self->total + in->a;", f"    {code}\n    (void)in->a;"
    )
    target = load_target(name)
    image = build_image(firmware(PROGRAM, tiny_bundle(PROGRAM, source), target, link_name), target, tmp_path)
    with openers()[link_name].open(target, image.elf, PROGRAM.id) as link:
        with pytest.raises(LinkError, match=f"the image faulted: FAULT {says}"):
            link.step(ONE_STEP(1.0, 0.0), 1)


def test_a_risc_v_without_its_tools_is_one_line_with_the_install_command(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """No compiler; a compiler without the C library; no emulator."""
    target = load_target("qemu_riscv32")
    monkeypatch.setenv("PATH", str(tmp_path))
    files = firmware(PROGRAM, BUNDLE, target, "uart")
    install = "apt-get install gcc-riscv64-unknown-elf picolibc-riscv64-unknown-elf"
    with pytest.raises(ToolError, match=f"riscv64-unknown-elf-gcc is not installed; install it with: {install}$"):
        build_image(files, target, tmp_path / "image")
    bare = tmp_path / target.compiler
    bare.write_text(
        "#!/bin/sh\necho \"$0: fatal error: cannot read spec file 'picolibc.specs': No such file\"\nexit 1\n"
    )
    bare.chmod(0o755)
    install = "apt-get install picolibc-riscv64-unknown-elf"
    with pytest.raises(ToolError, match=f"^picolibc.specs is not installed; install it with: {install}$"):
        build_image(files, target, tmp_path / "image")
    install = "apt-get install qemu-system-misc"
    with pytest.raises(ToolError, match=f"^qemu-system-riscv32 is not installed; install it with: {install}$"):
        open_semihosting(target, tmp_path / "image.elf", PROGRAM.id)

"""The image in QEMU over both of its lines: exact results, exact counts, and clean ends whatever dies first."""

from __future__ import annotations

import os
import signal
import struct
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from firmloop.codegen.bundle import CodegenError
from firmloop.codegen.firmware import firmware
from firmloop.codegen.target import Target, load_target
from firmloop.identify.simulation.compiler import ToolError, find_tool, run_compiler
from firmloop.identify.simulation.scratch import make_scratch
from firmloop.verify.build.cost import instructions
from firmloop.verify.build.image import Image, build_image
from firmloop.verify.link import LinkError
from firmloop.verify.links import semihosting, uart
from firmloop.verify.links.framed import FramedLink
from firmloop.verify.links.qemu import QemuProcess
from firmloop.verify.links.semihosting import open_semihosting
from firmloop.verify.links.uart import open_qemu_uart
from tests.verify.boards import BUNDLE, ONE_STEP, PROGRAM, RESULT, TARGET, build_qemu_image, expected, packed
from tests.verify.tiny import SOURCE, tiny_bundle

pytestmark = pytest.mark.qemu

Opener = Callable[[Target, Path, str], FramedLink]
PATIENCE = 300.0  # s, for what comes at once on a machine with time to spare
OPENERS: dict[str, Opener] = {"semihosting": open_semihosting, "uart": open_qemu_uart}


@pytest.fixture(scope="module")
def images(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Image]:
    return {name: build_qemu_image(name, tmp_path_factory.mktemp(name)) for name in OPENERS}


def emulators() -> set[str]:
    """Processes of ours that are a QEMU."""
    found = set()
    for folder in Path("/proc").iterdir():
        try:
            if folder.name.isdigit() and (folder / "comm").read_text().startswith("qemu-system") and os.stat(folder):
                parent = (folder / "stat").read_text().rpartition(")")[2].split()[1]
                if parent == str(os.getpid()):
                    found.add(folder.name)
        except OSError:
            continue
    return found


@pytest.fixture(params=OPENERS)
def link_name(request: pytest.FixtureRequest) -> str:
    return str(request.param)


def test_results_are_those_of_float32(images: dict[str, Image], link_name: str) -> None:
    a, b = np.random.default_rng(1).normal(size=(2, 150)).astype(np.float32)
    with OPENERS[link_name](TARGET, images[link_name].elf, PROGRAM.id) as link:
        hello = link.hello()
        assert (hello.program_id, hello.in_bytes, hello.out_bytes, hello.steps_max) == (PROGRAM.id, 8, 4, 64)
        for _ in range(2):
            link.reset()
            results = np.frombuffer(link.step(packed(a, b), 150), RESULT)
            np.testing.assert_array_equal(results["sum"], expected(a, b, 0.0)[0])
            np.testing.assert_array_equal(results["status"], b > 1.0)
    assert not emulators()


def counts(image: Image, opener: Opener, frame: int) -> np.ndarray:
    numbers = np.random.default_rng(2).normal(size=(256, 2)).astype("<f4")
    with opener(TARGET, image.elf, PROGRAM.id) as link:
        rows = [link.step(numbers[at : at + frame].tobytes(), frame) for at in range(0, 256, frame)]
        return instructions(np.frombuffer(b"".join(rows), RESULT)["ticks"], link.hello().overhead_ticks, TARGET)


def test_instruction_counts_are_the_same_in_every_run(images: dict[str, Image]) -> None:
    first = counts(images["semihosting"], open_semihosting, 64)
    np.testing.assert_array_equal(first, counts(images["semihosting"], open_semihosting, 64))
    np.testing.assert_array_equal(first, counts(images["semihosting"], open_semihosting, 1))


def test_instruction_count_is_that_of_the_listing(tmp_path: Path) -> None:
    """A step of which the instructions can be told by eye: the call, and 100 no-operations before the return."""
    body = 'uint32_t tiny_step(tiny_t *self, const tiny_in_t *in, tiny_out_t *out) {\n    __asm__ volatile("'
    source = SOURCE.format(gain="2.0F").replace(
        "uint32_t tiny_step(tiny_t *self, const tiny_in_t *in, tiny_out_t *out) {\n", body + "nop\\n" * 100 + '");\n'
    )
    costs = {}
    for name, text in (("plain", SOURCE.format(gain="2.0F")), ("longer", source)):
        files = firmware(PROGRAM, tiny_bundle(PROGRAM, text), TARGET, "semihosting")
        costs[name] = counts(build_image(files, TARGET, tmp_path / name), open_semihosting, 64)
    np.testing.assert_array_equal(costs["longer"], costs["plain"] + 100)


def test_a_stack_that_cannot_suffice_is_refused_when_built(tmp_path: Path) -> None:
    source = SOURCE.format(gain="2.0F").replace(
        "self->total = self->total + in->a;",
        "volatile uint8_t much[262000]; much[0] = 1U; self->total = (float)much[0];",
    )
    files = firmware(PROGRAM, tiny_bundle(PROGRAM, source), TARGET, "semihosting")
    with pytest.raises(
        CodegenError, match=r"qemu_mps2_an386: step\(\) needs 262\d\d\d bytes of stack .* stack_bytes = 262144"
    ):
        build_image(files, TARGET, tmp_path)


def test_stack_is_checked_where_run_time_functions_add_the_floats_and_where_no_stack_would_do(tmp_path: Path) -> None:
    source = SOURCE.format(gain="2.0F").replace(
        "self->total = self->total + in->a;",
        "volatile uint8_t much[20000]; much[0] = 1U; self->total = self->total + (float)much[0];",
    )
    target = load_target("qemu_microbit")
    says = (
        r"qemu_microbit: step\(\) needs 20\d\d\d bytes of stack and the image 512 more, but stack_bytes = 4096 of "
        "16384 bytes of RAM: make the controller smaller or choose a larger part"
    )
    with pytest.raises(CodegenError, match=says):
        build_image(firmware(PROGRAM, tiny_bundle(PROGRAM, source), target, "semihosting"), target, tmp_path)


@pytest.mark.parametrize(
    ("keyword", "memory"), [("static const", "flash, which has 262144"), ("static", "ram, which has")]
)
def test_an_image_larger_than_a_memory_is_refused_with_both_numbers(keyword: str, memory: str, tmp_path: Path) -> None:
    source = SOURCE.format(gain="2.0F").replace(
        "self->total = self->total + in->a;",
        f"{keyword} volatile uint8_t much[300000] = {{1U}}; self->total = self->total + (float)much[in->a > 0.0F];",
    )
    target = load_target("qemu_microbit")
    with pytest.raises(CodegenError, match=rf"qemu_microbit: the image needs .*3\d\d\d\d\d bytes of {memory}"):
        build_image(firmware(PROGRAM, tiny_bundle(PROGRAM, source), target, "semihosting"), target, tmp_path)


def test_stack_is_what_the_step_writes(tmp_path: Path) -> None:
    source = SOURCE.format(gain="2.0F").replace(
        "self->total = self->total + in->a;",
        "volatile uint32_t scratch[40];\n"
        "    for (uint32_t i = 0; i < 40U; i++) {\n        scratch[i] = i;\n    }\n"
        "    self->total = self->total + in->a + (float)scratch[0];",
    )
    image = build_image(firmware(PROGRAM, tiny_bundle(PROGRAM, source), TARGET, "semihosting"), TARGET, tmp_path)
    assert image.stack_bytes is not None and 160 <= image.stack_bytes <= 176
    with open_semihosting(TARGET, image.elf, PROGRAM.id) as link:
        link.step(ONE_STEP(1.0, 0.0), 1)
        assert link.stack(ONE_STEP(1.0, 0.0) * 100) == image.stack_bytes
        assert struct.unpack("<fII", link.step(ONE_STEP(1.0, 0.0), 1))[0] == 1.0  # starts anew


def test_image_of_another_program_is_refused(images: dict[str, Image], link_name: str) -> None:
    with pytest.raises(LinkError, match=f" in QEMU mps2-an386: the image runs program {PROGRAM.id}, this .* rebuild"):
        OPENERS[link_name](TARGET, images[link_name].elf, "0" * 16)
    assert not emulators()


def test_qemu_that_is_killed_is_noticed_at_once(
    images: dict[str, Image], link_name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(semihosting, "TIMEOUT", 10 * PATIENCE)
    monkeypatch.setattr(uart, "QEMU_TIMEOUT", 10 * PATIENCE)
    with OPENERS[link_name](TARGET, images[link_name].elf, PROGRAM.id) as link:
        link.reset()
        (process,) = emulators()
        os.kill(int(process), signal.SIGKILL)
        begin = time.monotonic()
        with pytest.raises(LinkError, match="QEMU ended with status -9; run again"):
            link.step(ONE_STEP(1.0, 0.0), 1)
        assert time.monotonic() - begin < PATIENCE
    with OPENERS[link_name](TARGET, images[link_name].elf, PROGRAM.id) as link:
        assert struct.unpack("<fII", link.step(ONE_STEP(1.0, 0.0), 1))[0] == 1.0


def test_a_closed_link_can_be_closed_again(images: dict[str, Image], link_name: str) -> None:
    link = OPENERS[link_name](TARGET, images[link_name].elf, PROGRAM.id)
    link.close()
    link.close()
    with pytest.raises(LinkError):
        link.reset()


def test_qemu_goes_with_an_exception(images: dict[str, Image], link_name: str) -> None:
    with pytest.raises(KeyboardInterrupt), OPENERS[link_name](TARGET, images[link_name].elf, PROGRAM.id):
        raise KeyboardInterrupt
    assert not emulators()


def test_qemu_goes_with_its_host(images: dict[str, Image], link_name: str, tmp_path: Path) -> None:
    """Even when the host is killed and can close nothing."""
    module = "semihosting" if link_name == "semihosting" else "uart"
    script = (
        f"import sys, time; from pathlib import Path\n"
        f"from codegen.target import load_target\n"
        f"from verify.links.{module} import {OPENERS[link_name].__name__} as opened\n"
        f"link = opened(load_target({TARGET.name!r}), Path({str(images[link_name].elf)!r}), {PROGRAM.id!r})\n"
        f"sys.stdout.write('open'); sys.stdout.flush(); time.sleep(60)\n"
    )
    environment = {**os.environ, "TMPDIR": str(tmp_path)}
    with subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, env=environment) as host:
        assert host.stdout is not None and host.stdout.read(4) == b"open"
        (folder,) = tmp_path.glob("firmloop.*")
        host.kill()
    deadline = time.monotonic() + PATIENCE
    while running_in(folder) and time.monotonic() < deadline:
        time.sleep(0.02)
    assert not running_in(folder)


def running_in(folder: Path) -> list[str]:
    found = []
    for process in Path("/proc").iterdir():
        try:
            if process.name.isdigit() and os.readlink(process / "cwd") == str(folder):
                found.append(process.name)
        except OSError:
            continue
    return found


def test_what_a_soft_float_core_needs_is_too_much(tmp_path: Path) -> None:
    """Of the helpers of a core without an FPU the compiler tells no stack; they take at most what is added."""
    source = SOURCE.format(gain="2.0F").replace(
        "self->total = self->total + in->a;",
        "volatile uint8_t much[2600]; much[0] = 1U; self->total = (float)much[0];",
    )
    small = load_target("qemu_stm32vldiscovery")
    files = firmware(PROGRAM, tiny_bundle(PROGRAM, source), small, "semihosting")
    with pytest.raises(CodegenError, match=r"step\(\) needs 27\d\d bytes of stack .* choose a larger part"):
        build_image(files, small, tmp_path)


def test_a_file_that_is_no_image_ends_in_bounded_time(tmp_path: Path, link_name: str) -> None:
    broken = tmp_path / "image.elf"
    broken.write_bytes(b"\x7fELF but not really")
    begin = time.monotonic()
    with pytest.raises(LinkError, match=r"QEMU"):
        OPENERS[link_name](TARGET, broken, PROGRAM.id)
    assert time.monotonic() - begin < PATIENCE
    assert not emulators()


@pytest.mark.parametrize(
    ("code", "says"),
    [
        ("*(volatile uint32_t *)0x60000000UL = 1U;", "cfsr=00008200.* bfar=60000000"),  # bus fault, address valid
        ('__asm__ volatile("udf #0");', "cfsr=00010000"),  # undefined instruction
        (
            '__asm__ volatile("mov sp, %0\\n push {r0}" ::"r"(0x60000000UL));',
            "sp=5fff.* stack=overrun; it needs more",
        ),
    ],
)
def test_a_fault_is_reported_with_its_registers(tmp_path: Path, link_name: str, code: str, says: str) -> None:
    source = SOURCE.format(gain="2.0F").replace(
        "    self->total = self->total + in->a;", f"    {code}\n    (void)in->a;"
    )
    files = firmware(PROGRAM, tiny_bundle(PROGRAM, source), TARGET, link_name)
    image = build_image(files, TARGET, tmp_path)
    with OPENERS[link_name](TARGET, image.elf, PROGRAM.id) as link:
        with pytest.raises(LinkError, match=f"the image faulted: FAULT icsr=.* {says}"):
            link.step(ONE_STEP(1.0, 0.0), 1)
    assert not emulators()


def test_a_step_that_never_ends_is_given_up(tmp_path: Path, link_name: str) -> None:
    source = SOURCE.format(gain="2.0F").replace(
        "self->total + in->a;", "self->total + in->a;\n    while (in->a > 1.0F) {\n    }"
    )
    image = build_image(firmware(PROGRAM, tiny_bundle(PROGRAM, source), TARGET, link_name), TARGET, tmp_path)
    with OPENERS[link_name](TARGET, image.elf, PROGRAM.id) as link:
        link.step(ONE_STEP(0.5, 0.0), 1)
        link._timeout = 0.3
        begin = time.monotonic()
        with pytest.raises(LinkError, match=r"no reply within 2 attempts of 0\.3 s"):
            link.step(ONE_STEP(2.0, 0.0), 1)
        assert time.monotonic() - begin < PATIENCE
    assert not emulators()


@pytest.mark.parametrize("missing", ["qemu-system-arm", "arm-none-eabi-gcc"])
def test_a_missing_tool_says_how_to_get_it(
    images: dict[str, Image], monkeypatch: pytest.MonkeyPatch, tmp_path: Path, missing: str
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path / "empty"))
    with pytest.raises(
        ToolError, match=f"{missing} is not installed; install it with: apt-get install .*{missing[-3:]}"
    ):
        if missing == "qemu-system-arm":
            open_semihosting(TARGET, images["semihosting"].elf, PROGRAM.id)
        else:
            build_image(firmware(PROGRAM, BUNDLE, TARGET, "uart"), TARGET, tmp_path / "image")
    assert not emulators()


def test_an_image_tells_its_sizes_compiler_and_flags(images: dict[str, Image]) -> None:
    image = images["semihosting"]
    assert 40 <= image.controller.text_bytes <= 100
    assert (image.controller.data_bytes, image.controller.bss_bytes) == (0, 0)
    assert image.whole.text_bytes > image.controller.text_bytes
    assert image.whole.bss_bytes > 262_144  # the stack is in it
    assert "-ffp-contract=off" in image.flags and "-fno-move-loop-stores" in image.flags
    assert image.compiler.startswith("arm-none-eabi-gcc")
    assert image.double_helpers == ()


def test_double_precision_that_crept_in_is_named(tmp_path: Path) -> None:
    source = SOURCE.format(gain="2.0F").replace("2.0F * in->b", "(float)((double)in->b * 0.1)")
    image = build_image(firmware(PROGRAM, tiny_bundle(PROGRAM, source), TARGET, "uart"), TARGET, tmp_path)
    assert {"__aeabi_dmul", "__aeabi_f2d"} <= set(image.double_helpers)
    assert image.stack_bytes is None  # what the run-time functions take is not known


def test_the_makefile_builds_the_same_image(images: dict[str, Image], tmp_path: Path) -> None:
    build_qemu_image("uart", tmp_path)
    (tmp_path / "image.elf").unlink()
    find_tool("make")
    run_compiler(["make"], tmp_path)
    assert (tmp_path / "image.elf").read_bytes() == images["uart"].elf.read_bytes()


SHELL = """\
static const char command[] = "COMMAND";
void start(void);
void start(void) {
    struct { const char *text; unsigned length; } asked = { command, sizeof command - 1U };
    register int function __asm__("r0") = 0x12; /* SYS_SYSTEM: Arm Semihosting specification */
    register void *block __asm__("r1") = &asked;
    __asm__ volatile("bkpt 0xAB" : "+r"(function) : "r"(block) : "memory");
    for (;;) { }
}
__attribute__((section(".vectors"))) const void *const vectors[2] = { (void *)0x20010000, (void *)start };
"""


def test_an_image_cannot_run_a_command_of_this_machine(tmp_path: Path) -> None:
    """As semihosting's SYSTEM would."""
    (tmp_path / "shell.c").write_text(SHELL.replace("COMMAND", f"touch {tmp_path}/RAN"))
    place = "-Wl,--section-start=.vectors=0,-Ttext=0x100,--entry=start,--undefined=vectors"
    flags = ("-mcpu=cortex-m4", "-mthumb", "-nostdlib", "-O1", place)
    run_compiler(["arm-none-eabi-gcc", *flags, "-o", "shell.elf", "shell.c"], tmp_path)
    assert TARGET.qemu is not None
    arguments = ("-serial", "none", "-semihosting-config", "enable=on,target=native")
    process = QemuProcess(TARGET.qemu, tmp_path / "shell.elf", arguments, (), make_scratch(tmp_path, "private", 0o700))
    deadline = time.monotonic() + PATIENCE
    while process.running() and not (tmp_path / "RAN").exists() and time.monotonic() < deadline:
        time.sleep(0.01)
    ended = not process.running()
    process.stop()
    assert not (tmp_path / "RAN").exists()
    assert ended, "the kernel ends an emulator that starts a program"

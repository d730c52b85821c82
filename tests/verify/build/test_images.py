"""Every emulated target computes every number format to the bit; bench/codegen/every_target.py is the full table."""

from __future__ import annotations

import os
import time
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from bench.codegen.every_target import emulated, numbers_of
from firmloop.codegen.emit import emit
from firmloop.codegen.firmware import firmware
from firmloop.codegen.target import Target
from firmloop.quantize.lower.lower import lower
from firmloop.verify.build.cost import instructions
from firmloop.verify.build.image import build_image
from firmloop.verify.links.pty import open_qemu_pty
from firmloop.verify.links.qemu import QemuProcess
from firmloop.verify.links.uart import open_qemu_uart
from firmloop.verify.run import verify_on
from firmloop.verify.trial import Trial, try_out
from firmloop.verify.verdict import Verdict
from tests.laws import FULL, pid
from tests.verify.boards import BUNDLE, ONE_STEP, PROGRAM, RESULT

pytestmark = pytest.mark.qemu

TARGETS = {target.name: target for target in emulated()}
FALLING_ASLEEP = 20.0  # s at most, on a busy machine
CASES = [(name, number) for name, target in TARGETS.items() for number in numbers_of(target)]


@cache
def tried(number: str, steps: int) -> Trial:
    """Return the trial on this machine, which is the same for every target."""
    law = pid(FULL)
    program = lower(law, number)
    return try_out(law, program, emit(program, "test"), (), steps, 1, lambda share, doing: None)


def verdict_of(target: Target, number: str, steps: int, link: str | None) -> Verdict:
    return verify_on(tried(number, steps), target, link, lambda share, doing: None)


def test_the_cores_that_users_have_are_there() -> None:
    cores = {target.core for target in TARGETS.values()}
    assert cores == {*(f"cortex-{core}" for core in ("m0", "m3", "m4", "m7", "m33", "m55")), "rv32imac"}
    assert len(TARGETS) == 9


@pytest.mark.parametrize("name", TARGETS)
def test_float32_agrees_to_the_bit(name: str) -> None:
    verdict = verdict_of(TARGETS[name], "float32", 2_000, None)
    assert verdict.agrees, verdict.first


@pytest.mark.slow
@pytest.mark.parametrize(("name", "number"), CASES)
def test_every_format_agrees_to_the_bit(name: str, number: str) -> None:
    verdict = verdict_of(TARGETS[name], number, 20_000, None)
    assert verdict.agrees, verdict.first


@pytest.mark.parametrize(
    ("name", "number"), [("qemu_mps2_an500", "float64"), ("qemu_mps3_an547", "float64"), ("qemu_microbit", "fixed16")]
)
def test_formats_that_a_core_is_special_for(name: str, number: str) -> None:
    assert verdict_of(TARGETS[name], number, 2_000, None).agrees


@pytest.mark.parametrize("link", ["uart", "pty"])
@pytest.mark.parametrize("name", ["qemu_microbit", "qemu_netduinoplus2", "qemu_riscv32"])
def test_the_uart_of_each_family_carries_it(name: str, link: str) -> None:
    verdict = verdict_of(TARGETS[name], "fixed32", 100, link)
    assert verdict.agrees and verdict.link == link


@pytest.mark.parametrize("name", TARGETS)
def test_an_image_sleeps_until_its_uart_has_a_byte_and_counts_the_same(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Every step in a frame of its own, so that the image falls asleep and is woken between any two."""
    target = TARGETS[name]
    started: list[int] = []
    start = QemuProcess.__init__

    def remember(self: QemuProcess, *arguments: object) -> None:
        start(self, *arguments)  # type: ignore[arg-type]
        started.append(self.number)

    monkeypatch.setattr(QemuProcess, "__init__", remember)
    image = build_image(firmware(PROGRAM, BUNDLE, target, "uart"), target, tmp_path)
    free, runs = os.sched_getaffinity(0), []
    for opened in (open_qemu_uart, open_qemu_pty):
        with opened(target, image.elf, PROGRAM.id) as link:
            rows = [link.step(ONE_STEP(0.3 * k, 1.7 - k), 1) for k in range(20)]
            ticks = np.frombuffer(b"".join(rows), RESULT)["ticks"]
            runs.append(instructions(ticks, link.hello().overhead_ticks, target))
            assert falls_asleep(started[-1])
        assert os.sched_getaffinity(0) == free
    np.testing.assert_array_equal(runs[0], runs[1])


def falls_asleep(process: int) -> bool:
    """Say whether all its threads sleep at ten looks in succession; one that asks runs, or waits for its turn."""
    asleep, deadline = 0, time.monotonic() + FALLING_ASLEEP
    while asleep < 10 and time.monotonic() < deadline:
        # Field 3 of proc(5) stat, the first behind the parenthesis that ends the name, is the state.
        stats = [path.read_text() for path in Path(f"/proc/{process}/task").glob("*/stat")]
        asleep = asleep + 1 if all(stat.rpartition(")")[2].split()[0] == "S" for stat in stats) else 0
        time.sleep(0.005)
    return asleep == 10


def test_two_timers_count_the_same_instructions() -> None:
    """CMSDK on the one, SysTick with its 24 bits on the other; both cores run the same code."""
    apb, systick = (
        verdict_of(TARGETS[name], "fixed32", 1_000, None).cost for name in ("qemu_mps2_an386", "qemu_netduinoplus2")
    )
    assert apb.instructions_max == systick.instructions_max
    assert apb.instructions_mean == systick.instructions_mean

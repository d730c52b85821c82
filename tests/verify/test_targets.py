"""Every emulated target computes every number format to the bit; bench/every_target.py is the full table."""

from __future__ import annotations

import pytest

from bench.every_target import emulated, numbers_of
from codegen.emit import emit
from codegen.target import Target
from quantize.lower import lower
from tests.laws import FULL, pid
from verify.run import verify
from verify.verdict import Verdict

pytestmark = pytest.mark.qemu

TARGETS = {target.name: target for target in emulated()}
CASES = [(name, number) for name, target in TARGETS.items() for number in numbers_of(target)]


def verdict_of(target: Target, number: str, steps: int, link: str | None) -> Verdict:
    law = pid(FULL)
    program = lower(law, number)
    return verify(law, program, emit(program, "test"), target, (), steps, 1, link, lambda share, doing: None)


def test_the_cores_that_users_have_are_there() -> None:
    cores = {target.core for target in TARGETS.values()}
    assert cores == {f"cortex-{core}" for core in ("m0", "m3", "m4", "m7", "m33", "m55")}
    assert len(TARGETS) == 8


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
@pytest.mark.parametrize("name", ["qemu_microbit", "qemu_netduinoplus2"])
def test_the_uart_of_each_family_carries_it(name: str, link: str) -> None:
    verdict = verdict_of(TARGETS[name], "fixed32", 100, link)
    assert verdict.agrees and verdict.link == link


def test_two_timers_count_the_same_instructions() -> None:
    """CMSDK on the one, SysTick with its 24 bits on the other; both cores run the same code."""
    apb, systick = (
        verdict_of(TARGETS[name], "fixed32", 1_000, None).cost for name in ("qemu_mps2_an386", "qemu_netduinoplus2")
    )
    assert apb.instructions_max == systick.instructions_max
    assert apb.instructions_mean == systick.instructions_mean

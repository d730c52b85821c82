"""The loop closed step by step: the same bits on host and emulated controller, and the plant's own physics."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bench.links.closed_loop import ROLES, staircase, wheel
from firmloop.codegen.emit import emit
from firmloop.codegen.firmware import firmware
from firmloop.codegen.target import load_target
from firmloop.identify.plants.attach import with_effects
from firmloop.quantize.lower.lower import lower
from firmloop.quantize.program import Program
from firmloop.verify.build.host import build_host
from firmloop.verify.build.image import build_image
from firmloop.verify.links.library import LibraryLink
from firmloop.verify.links.opener import openers
from firmloop.verify.proofs.closed_loop import PlantLoop, check_loop, close_loop
from firmloop.verify.run import verify
from tests.laws import FULL, pid
from tests.sizes import motor, use_of


@pytest.mark.qemu
@pytest.mark.parametrize(("name", "number"), [("qemu_mps2_an386", "fixed32"), ("qemu_microbit", "float32")])
def test_the_loop_is_the_same_on_host_and_controller(name: str, number: str, tmp_path: Path) -> None:
    program, target, loop = lower(pid(FULL), number), load_target(name), PlantLoop(wheel(), staircase(1_000), ROLES)
    bundle = emit(program, "test")
    on_host = close_loop(program, loop, LibraryLink(build_host(bundle, load_target("host")), program))
    image = build_image(firmware(program, bundle, target, "semihosting"), target, tmp_path)
    with openers()["semihosting"].open(target, image.elf, program.id) as link:
        on_target = close_loop(program, loop, link)
    assert on_target.same_as(on_host)
    assert np.abs(on_target.reference - on_target.measurement)[499] < 1.0  # it does control
    assert not replace(on_target, measurement=on_target.measurement + 1e-9).same_as(on_host)


def on_host(table: dict[str, object], number: str) -> tuple[LibraryLink, Program]:
    program = lower(pid(table), number)
    return LibraryLink(build_host(emit(program, "test"), load_target("host")), program), program


def test_a_controller_that_is_another_is_seen_in_the_loop() -> None:
    loop = PlantLoop(wheel(), staircase(600), ROLES)
    (host, program), (other, _) = on_host(FULL, "float32"), on_host({**FULL, "ki": 1.400001}, "float32")
    assert check_loop(program, loop, host, host).different == ()
    different = check_loop(program, loop, host, other).different
    assert different and different[0] > 0  # the integral has to grow before its gain shows


@pytest.mark.qemu
def test_the_loop_is_part_of_the_verdict() -> None:
    law = pid(FULL)
    program = lower(law, "fixed16")
    loop = PlantLoop(wheel(), staircase(200), ROLES)
    target = load_target("qemu_mps2_an386")
    verdict = verify(law, program, emit(program, "test"), target, (), 200, 1, None, lambda share, doing: None, loop)
    assert verdict.agrees and verdict.as_dict()["closed_loop"] == {"steps": 200, "differences": 0}


@pytest.mark.qemu
def test_a_plant_with_effects_gives_the_same_loop_on_the_controller() -> None:
    plant = motor("speed_rad_s", "current_A")
    names = ("stribeck_friction", "cogging_torque", "backlash", "dead_zone", "slew_rate_limit", "sensor_delay")
    loop = PlantLoop(with_effects(plant, [use_of(plant, name) for name in names]), staircase(300), ROLES)
    law = pid(FULL)
    program = lower(law, "fixed32")
    target = load_target("qemu_mps2_an386")
    verdict = verify(law, program, emit(program, "test"), target, (), 100, 1, None, lambda share, doing: None, loop)
    assert verdict.agrees and verdict.as_dict()["closed_loop"] == {"steps": 300, "differences": 0}
    assert verdict.closed_loop is not None and np.ptp(verdict.closed_loop.measurement) > 1.0

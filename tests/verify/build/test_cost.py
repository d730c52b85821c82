"""What a step costs is a fact: the worst input is kept, runs repeat it, and growth beyond a threshold is status 1."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from firmloop.cli import main
from firmloop.codegen.emit import emit
from firmloop.codegen.firmware import firmware
from firmloop.codegen.target import Timer, load_target
from firmloop.quantize.lower.lower import lower
from firmloop.verify.build.cost import instructions
from firmloop.verify.build.image import build_image
from firmloop.verify.links.pty import start_on_terminal
from firmloop.verify.links.semihosting import open_semihosting
from firmloop.verify.run import verify
from firmloop.verify.verdict import Verdict
from tests.laws import FULL, pid
from tests.verify.boards import RESULT
from tests.verify.links.test_faults import PROJECT
from tests.verify.tiny import SOURCE, tiny, tiny_bundle

pytestmark = pytest.mark.qemu


def verdict_on(name: str) -> Verdict:
    law = pid(FULL)
    program = lower(law, "float32")
    bundle = emit(program, "test")
    return verify(law, program, bundle, load_target(name), (), 1_000, 1, None, lambda share, doing: None)


def test_the_worst_step_is_kept_and_costs_the_same_again() -> None:
    first, again = (verdict_on("qemu_microbit").as_dict() for _ in range(2))
    assert first["cost"] == again["cost"] and first["worst_step"] == again["worst_step"]
    cost, worst = first["cost"], first["worst_step"]
    assert isinstance(cost, dict) and isinstance(worst, dict)
    assert cost["instructions_min"] < cost["instructions_mean"] < cost["instructions_max"]
    assert cost["cycles_max"] is None
    assert 0 < cost["stack_painted_bytes"] < 2_048
    assert set(worst["inputs"]) == {"reference", "measurement"} and 0 <= worst["step"] < 1_000


def test_a_step_longer_than_the_counter_is_counted(tmp_path: Path) -> None:
    """SysTick has 24 bits: at 168 MHz and 64 ns an instruction they last 1.56 million instructions."""
    target = load_target("qemu_netduinoplus2")
    program, _ = tiny(2.0)
    costs = {}
    for count in (1_000, 3_001_000):
        loop = f"for (volatile uint32_t k = 0; k < {count // 5}U; k = k + 1U) {{ }}\n    self->total ="
        source = SOURCE.format(gain="2.0F").replace("self->total =", loop, 2).replace(loop, "self->total =", 1)
        files = firmware(program, tiny_bundle(program, source), target, "semihosting")
        image = build_image(files, target, tmp_path / str(count))
        with open_semihosting(target, image.elf, program.id) as link:
            rows = np.frombuffer(link.step(b"\0" * 16, 2), RESULT)
            counted = instructions(rows["ticks"], link.hello().overhead_ticks, target)
            assert counted[0] == pytest.approx(counted[1], abs=2)  # an interrupt may fall on either
            costs[count] = int(counted[0])
    per_turn = (costs[3_001_000] - costs[1_000]) / (3_000_000 // 5)
    assert per_turn == pytest.approx(round(per_turn), abs=1e-4)
    assert costs[3_001_000] > 2**24 * 1e9 / 168e6 / 64


def test_cycles_are_told_of_boards_only(tmp_path: Path) -> None:
    """A board's image in the emulator: its cycle counter stands still there, but the path is the one of a board."""
    law = pid(FULL)
    program = lower(law, "float32")
    bundle = emit(program, "test")
    emulated = load_target("qemu_mps2_an386")
    board = replace(emulated, name="board", qemu=None, timer=Timer("dwt", 0xE000_1000, 32))
    image = build_image(firmware(program, bundle, board, "uart"), board, tmp_path)
    process, port = start_on_terminal(emulated, image.elf)
    try:
        verdict = verify(law, program, bundle, board, (), 20, 1, port, lambda share, doing: None)
    finally:
        process.stop()
    assert verdict.agrees and verdict.cost.cycles_max == 0 and verdict.cost.instructions_max is None
    assert verdict.cost.stack_painted_bytes is not None


def test_growth_is_status_1(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    project, out, old = tmp_path / "wheel.toml", tmp_path / "out", tmp_path / "old.json"
    project.write_text(PROJECT)
    command = ["verify", str(project), "--out", str(out), "--target", "qemu_mps2_an385", "--steps", "100"]
    assert main(command) == 0
    document = json.loads((out / "verdict.json").read_text())
    old.write_text(json.dumps(document))
    assert main([*command, "--baseline", str(old)]) == 0
    document["cost"]["instructions_max"] = round(document["cost"]["instructions_max"] * 0.9)
    old.write_text(json.dumps(document))
    capsys.readouterr()
    assert main([*command, "--baseline", str(old)]) == 1
    assert "MORE THAN 2 % ALLOWED" in capsys.readouterr().out
    assert main([*command, "--baseline", str(old), "--growth", "50"]) == 0
    old.write_text(json.dumps({**document, "target": "qemu_microbit"}))
    capsys.readouterr()
    assert main([*command, "--baseline", str(old)]) == 2
    told = capsys.readouterr()
    assert told.out == "" and "is of target qemu_microbit, but what is to run is qemu_mps2_an385" in told.err
    old.write_text("[]")
    assert main([*command, "--baseline", str(old)]) == 2
    assert "holds no costs; name the cost.json or verdict.json of an earlier run" in capsys.readouterr().err


def test_the_cost_table_holds_every_function_and_is_a_baseline(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    project, out, old = tmp_path / "wheel.toml", tmp_path / "out", tmp_path / "old.json"
    project.write_text(PROJECT)
    command = ["verify", str(project), "--out", str(out), "--target", "qemu_mps2_an385", "--steps", "100"]
    assert main(command) == 0
    document = json.loads((out / "cost.json").read_text())
    own = document["targets"]["qemu_mps2_an385"]
    step, init = (own["functions"][f"wheel_{name}"] for name in ("step", "init"))
    assert step["instructions_max"] == own["cost"]["instructions_max"] and init["instructions_max"] is None
    assert step["stack_bytes"] == own["cost"]["stack_bytes"] and init["stack_bytes"] is not None
    assert 0 < step["text_bytes"] + init["text_bytes"] <= own["cost"]["text_bytes"]
    own["functions"]["wheel_init"]["text_bytes"] -= 2
    old.write_text(json.dumps(document))
    capsys.readouterr()
    assert main([*command, "--baseline", str(old)]) == 1
    (grown,) = [line for line in capsys.readouterr().out.splitlines() if "MORE THAN" in line]
    assert "wheel_init text_bytes" in grown

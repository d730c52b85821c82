"""Host and emulator may wait for each other or ask: what they say is the same, and the faster way is found and left."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from firmloop.verify.build.cost import instructions
from firmloop.verify.links.semihosting import open_semihosting
from firmloop.verify.links.turns import Processors, Turns, share_processor
from tests.verify.boards import PROGRAM, RESULT, TARGET, build_qemu_image, expected, packed

WAITING = 15e-6  # s of one exchange
Cost = Callable[[float], float]  # s of one exchange by asking, at a time in s


class Line:
    """A way of which the test knows what each exchange takes."""

    def __init__(self, asking: Cost, possible: bool = True) -> None:
        self._asking = asking
        self._possible = possible
        self._asks = False
        self.now = 0.0
        self.asked = 0.0  # s spent asking
        self.turns = Turns(self, self.now)

    def ask(self) -> bool:
        self._asks = self._possible
        return self._possible

    def wait(self) -> None:
        self._asks = False

    def run(self, exchanges: int) -> float:
        begin = self.now
        for _ in range(exchanges):
            self.turns.count(self.now)
            assert self.turns.asking == self._asks
            took = self._asking(self.now) if self._asks else WAITING
            self.asked += took if self._asks else 0.0
            self.now += took
        return self.now - begin


def test_it_asks_where_that_is_faster() -> None:
    line = Line(lambda now: 9e-6)
    took = line.run(400_000)
    assert line.asked > 0.96 * took


def test_it_waits_where_asking_is_slower() -> None:
    line = Line(lambda now: 20e-6)
    assert line.run(400_000) < 1.002 * 400_000 * WAITING


def test_one_answer_that_takes_long_ends_asking() -> None:
    line = Line(lambda now: 0.02)  # the emulator does not get its processor before the end of somebody's turn
    assert line.run(400_000) < 400_000 * WAITING + 7 * 0.021
    assert 0.0 < line.asked < 7 * 0.021


def test_asking_ends_when_the_machine_becomes_busy_and_begins_again_when_it_is_not() -> None:
    line = Line(lambda now: 0.02 if 1.0 < now < 5.0 else 9e-6)
    line.run(100_000)
    assert line.turns.asking and line.now < 1.0
    line.run(200_000)
    before = line.asked
    line.run(1000)
    assert 1.0 < line.now < 5.0 and line.asked == before
    line.run(380_000)
    assert line.turns.asking


def test_where_asking_cannot_be_it_waits() -> None:
    line = Line(lambda now: 9e-6, possible=False)
    line.run(200_000)
    assert line.asked == 0.0


def test_processors_go_back_to_what_they_were() -> None:
    before = os.sched_getaffinity(0)
    processors = Processors()
    shared = os.sched_getaffinity(0)
    assert len(shared) == 1 and shared <= before
    assert processors.apart() == (len(before) > 1)
    assert os.sched_getaffinity(0) == (before - shared or shared)
    processors.together()
    assert os.sched_getaffinity(0) == shared
    processors.undo()
    assert os.sched_getaffinity(0) == before


def test_a_processor_is_shared_only_with_an_image_that_sleeps() -> None:
    before = os.sched_getaffinity(0)
    assert TARGET.uart is not None
    undo = share_processor(TARGET)
    assert len(os.sched_getaffinity(0)) == 1
    undo()
    assert os.sched_getaffinity(0) == before
    share_processor(replace(TARGET, uart=replace(TARGET.uart, interrupt=None)))
    assert os.sched_getaffinity(0) == before


def test_where_nobody_may_choose_a_processor_nothing_is_shared(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(thread: int, processors: set[int]) -> None:
        raise PermissionError

    before = os.sched_getaffinity(0)
    monkeypatch.setattr(os, "sched_setaffinity", refuse)
    share_processor(TARGET)()
    assert os.sched_getaffinity(0) == before


@pytest.mark.qemu
def test_asking_changes_no_result(tmp_path_factory: pytest.TempPathFactory) -> None:
    image = build_qemu_image("semihosting", tmp_path_factory.mktemp("image"))
    a, b = np.random.default_rng(3).normal(size=(2, 300)).astype(np.float32)
    inputs = packed(a, b)
    runs = []
    for ask in (False, True):
        with open_semihosting(TARGET, image.elf, PROGRAM.id) as link:
            assert link._pipe is not None
            if ask and not link._pipe._way.ask():
                pytest.skip("one processor, or a kernel that does not let us: there is nothing but to wait")
            replies = [link.step(inputs[at : at + 8], 1) for at in range(0, len(inputs) // 2, 8)]
            if ask:
                threading.Event().wait(0.05)  # long enough for the image to look whether we are there
                link._pipe._way.wait()
            replies += [link.step(inputs[at : at + 8], 1) for at in range(len(inputs) // 2, len(inputs), 8)]
            results = np.frombuffer(b"".join(replies), RESULT)
            counts = instructions(results["ticks"], link.hello().overhead_ticks, TARGET)
            runs.append((results["sum"], results["status"], counts))
    np.testing.assert_array_equal(runs[0], runs[1])
    np.testing.assert_array_equal(runs[0][0], expected(a, b, 0.0)[0])


@pytest.mark.qemu
def test_an_image_that_asks_ends_when_the_host_goes(tmp_path_factory: pytest.TempPathFactory) -> None:
    image = build_qemu_image("semihosting", tmp_path_factory.mktemp("image"))
    with open_semihosting(TARGET, image.elf, PROGRAM.id) as link:
        assert link._pipe is not None
        link._pipe._way.ask()
        process = link._pipe._way._process
        link.reset()
    with pytest.raises(ProcessLookupError):
        os.kill(process, 0)

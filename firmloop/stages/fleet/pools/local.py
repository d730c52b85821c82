"""Diagnose on the processors of this machine: a few worker processes, each given the next task when it is free."""

from __future__ import annotations

import os
import pickle
import queue
import subprocess
import sys
import threading
from collections.abc import Iterable, Iterator
from functools import partial

from firmloop.identify.extras import ToolError
from firmloop.stages.fleet.member import FleetTask
from firmloop.stages.fleet.pools.pool import Answer, Failed, Pool, Work, passed_on
from firmloop.stages.fleet.pools.serve import COMMAND

Answers = queue.SimpleQueue[tuple[FleetTask, Answer | ToolError] | BaseException | None]


def local(count: int) -> Pool:
    """Return a pool of `count` processes."""
    return partial(_work, count)


def processors() -> int:
    """Return how many processors this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _work(count: int, work: Work, tasks: Iterable[FleetTask]) -> Iterator[tuple[FleetTask, Answer]]:
    answers: Answers = queue.SimpleQueue()
    shared = _Shared(iter(tasks))
    keepers = [_Keeper(work, shared, answers) for _ in range(count)]
    try:
        for keeper in keepers:
            keeper.start()
        ended = 0
        while ended < count:
            answer = answers.get()
            if answer is None:
                ended += 1
            elif isinstance(answer, BaseException):
                raise answer
            else:
                yield answer[0], passed_on(answer[1])
    finally:
        for keeper in keepers:
            keeper.stop()


class _Shared:
    """The tasks, one at a time to whoever asks."""

    def __init__(self, tasks: Iterator[FleetTask]) -> None:
        self._tasks, self._lock = tasks, threading.Lock()

    def next(self) -> FleetTask | None:
        """Return the next task; None where there is none left."""
        with self._lock:
            return next(self._tasks, None)


class _Keeper(threading.Thread):
    """Keeps one worker process busy; one that dies over a task is replaced, and the task is said to have failed."""

    def __init__(self, work: Work, tasks: _Shared, answers: Answers) -> None:
        super().__init__(daemon=True)
        self._work, self._tasks, self._answers = work, tasks, answers
        self._process: subprocess.Popen[bytes] | None = None
        self._stopped = threading.Event()

    def run(self) -> None:
        """Give tasks until none is left."""
        try:
            while not self._stopped.is_set() and (task := self._tasks.next()) is not None:
                self._answers.put((task, self._ask(task)))
        except Exception as error:
            self._answers.put(error)
        finally:
            self.stop()
            self._answers.put(None)

    def stop(self) -> None:
        """End the process, whatever it does."""
        self._stopped.set()
        if self._process is not None and self._process.poll() is None:
            self._process.terminate()
            self._process.wait()

    def _ask(self, task: FleetTask) -> Answer | ToolError:
        process = self._process
        if process is None or process.poll() is not None:
            process = self._process = _started(self._work)
        assert process.stdin is not None and process.stdout is not None
        try:
            pickle.dump(task, process.stdin)
            process.stdin.flush()
            answer: Answer | ToolError = pickle.load(process.stdout)
        except (EOFError, OSError, pickle.UnpicklingError):
            return Failed(
                f"its process ended with status {process.wait()}: where memory is short, give fewer --workers"
            )
        return answer


def _started(work: Work) -> subprocess.Popen[bytes]:
    """Start a worker that finds modules where this process does, and never in the folder it is started in."""
    found = {**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
    command = [sys.executable, "-P", "-c", COMMAND]
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=found)
    assert process.stdin is not None
    pickle.dump(work, process.stdin)
    return process

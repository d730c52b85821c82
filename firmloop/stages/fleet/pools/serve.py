"""A worker process: reads tasks from its standard input, and writes an answer each, until there are no more.

Its input ends when its owner ends, however that comes about; so no worker outlives its owner by more than a task.
"""

from __future__ import annotations

import os
import pickle
import signal
import sys
from contextlib import suppress

from firmloop.stages.fleet.pools.pool import answered

COMMAND = f"from {__name__} import serve; serve()"


def serve() -> None:
    """Work until the input ends; what a library prints goes to stderr, not among the answers."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the owner, which then ends this
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    with suppress(EOFError, BrokenPipeError):
        work = pickle.load(sys.stdin.buffer)
        while True:
            task = pickle.load(sys.stdin.buffer)
            pickle.dump(answered(work, task), answers)
            answers.flush()

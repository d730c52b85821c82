"""Run the command line, as `firmloop` and as `python -m firmloop`; no Ctrl-C, however early, ends in a traceback."""

from __future__ import annotations

import os
import signal
import sys
from importlib import import_module
from typing import NoReturn


def start() -> NoReturn:
    """Run one command, and exit with its status.

    Ctrl-C is a matter of `cli.main` alone. Before, while modules are imported, and after, while Python ends, it ends
    the process as it does any other program: Python would print a traceback.
    """
    asked = signal.getsignal(signal.SIGINT) == signal.default_int_handler  # not where it is ignored, as under nohup
    if asked:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    main = import_module("firmloop.cli").main
    if asked:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    status: int = main(sys.argv[1:])
    if asked:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    sys.exit(status)


if __name__ == "__main__":
    # Python looks for modules first in the folder it is started in; a project's folder holds data, and runs nothing.
    if not sys.flags.safe_path and sys.path[0] != os.path.dirname(os.path.dirname(os.path.abspath(__file__))):
        del sys.path[0]
    start()

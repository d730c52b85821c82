"""Run the command line as `python -m firmloop`."""

from __future__ import annotations

import os
import sys
from importlib import import_module

if __name__ == "__main__":
    # Python looks for modules first in the folder it is started in; a project's folder holds data, and runs nothing.
    if not sys.flags.safe_path and sys.path[0] != os.path.dirname(os.path.dirname(os.path.abspath(__file__))):
        del sys.path[0]
    sys.exit(import_module("firmloop.cli").main(sys.argv[1:]))

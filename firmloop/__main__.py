"""Run the command line as `python -m firmloop`."""

from __future__ import annotations

import sys

from firmloop.cli import main

if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

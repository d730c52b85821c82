"""Draw the README's picture, docs/walk.svg, from a walk through the example.

.venv/bin/python docs/picture.py
"""

from __future__ import annotations

from pathlib import Path

import firmloop as fl
from firmloop.console import progress
from firmloop.presentation.report import picture

ROOT = Path(__file__).parents[1]

if __name__ == "__main__":
    walked = fl.run(fl.load(ROOT / "examples" / "wheel_speed" / "wheel_speed.toml"), stage=progress)
    (ROOT / "docs" / "walk.svg").write_text(picture(walked.walk))

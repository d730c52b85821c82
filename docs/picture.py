"""Draw the README's picture, docs/walk.svg, from a walk through the example.

.venv/bin/python docs/picture.py
"""

from __future__ import annotations

from pathlib import Path

from firmloop.console import TextConsole
from firmloop.presentation.report import picture
from firmloop.project.project import Campaign, read_project
from firmloop.verbs import walk

ROOT = Path(__file__).parents[1]

if __name__ == "__main__":
    project = read_project(ROOT / "examples" / "wheel_speed" / "wheel_speed.toml")
    campaign = Campaign(project.targets, steps=100_000, seed=1, port=None)
    (ROOT / "docs" / "walk.svg").write_text(picture(walk(project, campaign, TextConsole())))

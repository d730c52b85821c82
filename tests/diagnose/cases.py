"""Small projects with something concealed, made by the truth of the benchmark."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from bench.blind_cases import draw_case, single_case, write_case
from bench.concealed import MACHINES
from firmloop.cli import main

BY_NAME = {machine.name: machine for machine in MACHINES}


def concealed(folder: Path, name: str, size: float, colored: bool) -> Path:
    """Write a project whose motor conceals one effect (an empty name: none); return the project file."""
    case = single_case(5, name, BY_NAME["flat_motor"], ("speed", "current"), "mixed", colored, size)
    write_case(case, folder / "case", folder / "labels")
    return folder / "case" / "project.toml"


def drawn(folder: Path, seed: int) -> Path:
    """Write the project of a case of the benchmark; return the project file."""
    write_case(draw_case(seed), folder / "case", folder / "labels")
    return folder / "case" / "project.toml"


def diagnosis(project: Path, out: Path) -> tuple[int, dict[str, Any]]:
    """Diagnose by the command line; return the exit status and diagnosis.json."""
    status = main(["diagnose", str(project), "--out", str(out)])
    return status, json.loads((out / "diagnosis.json").read_text(encoding="utf-8"))

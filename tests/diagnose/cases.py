"""Small projects with something concealed, made by the truth of the benchmark."""

from __future__ import annotations

from pathlib import Path

from bench.blind_cases import single_case, write_case
from bench.concealed import MACHINES

BY_NAME = {machine.name: machine for machine in MACHINES}


def concealed(folder: Path, name: str, size: float, colored: bool) -> Path:
    """Write a project whose motor conceals one effect (an empty name: none); return the project file."""
    case = single_case(5, name, BY_NAME["flat_motor"], ("speed", "current"), "mixed", colored, size)
    write_case(case, folder / "case", folder / "labels")
    return folder / "case" / "project.toml"

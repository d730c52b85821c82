"""The verb generate: write the C, its manifest and its proof."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path

from firmloop.codegen.bundle import write_files
from firmloop.console import Console, progress
from firmloop.design.design import Design
from firmloop.output import results_folder
from firmloop.presentation.code_words import about_code
from firmloop.project.project import Project, require
from firmloop.stages.making import Generated, command_of, design, plant_of
from firmloop.stages.making import generate as generate_code

AGREES = 0


def generate(project: Project, out: Path, console: Console) -> int:
    """Write the C and OUT/manifest.json."""
    require(project, "controller", "signals", "arithmetic")
    with results_folder(out, ()) as folder:
        plant = plant_of(project) if project.plant else None
        generated = generate_files(project, design(project, plant), "generate", console)
        files = c_files(generated)
        write_files(files, folder)
    written(console, out, files)
    return AGREES


def generate_files(project: Project, designed: Design, verb: str, console: Console) -> Generated:
    """Generate for a verb, and tell what was made."""
    with progress("generating C"):
        generated = generate_code(project, designed, command_of(verb, project.path))
    console.lines(about_code(generated))
    sizes = {name: len(text.encode()) for name, text in generated.bundle.files.items()}
    console.result("code", {"manifest": generated.manifest, "bytes": sizes})
    return generated


def c_files(generated: Generated) -> dict[str, str]:
    """Return every file of the C and around it, by its name."""
    made = {**generated.bundle.files, **generated.package}
    return {**made, "manifest.json": as_json(generated.manifest), "proof.json": as_json(generated.proof)}


def as_json(document: Mapping[str, object]) -> str:
    """Write a result file."""
    return json.dumps(document, indent=1, allow_nan=False) + "\n"


def written(console: Console, folder: Path, names: Sequence[str] | Mapping[str, str]) -> None:
    """Tell where the results are; those that a person opens in words."""
    console.lines(
        [f"written: {folder / name}" for name in names if name.endswith((".html", ".toml", ".csv", ".gz", ".svg"))]
    )
    console.result("written", [str(folder / name) for name in names])

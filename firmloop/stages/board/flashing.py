"""Build a controller's image and put it onto a board, or say which file to drag where."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from firmloop.codegen.bundle import CodegenError
from firmloop.codegen.firmware import firmware, live_firmware
from firmloop.codegen.target import Target, load_target
from firmloop.identify.regular_file import read_text
from firmloop.identify.simulation.compiler import ToolError
from firmloop.project.project import Project, require
from firmloop.project.table import ProjectError
from firmloop.stages.making import design, generate
from firmloop.stages.plant import command_of, located, plant_of
from firmloop.verify.build.flash import drag_file, flash_command
from firmloop.verify.build.flash import flash as flash_board
from firmloop.verify.build.image import ELF, Size, build_image

TRANSPORT = "uart"


def _command(project: Project) -> str:
    return command_of("flash", project.path)


def live_source(path: Path) -> str:
    """Return the text of the C file between a controller and its sensors and actuators."""
    if path.suffix != ".c":
        raise ProjectError(f"--live {path}: must be a C file")
    try:
        return read_text(path)
    except (OSError, UnicodeDecodeError) as error:
        raise ProjectError(f"--live {path}: cannot be read: {error}") from None


@dataclass(frozen=True, slots=True)
class Built:
    """An image: the names of its files in their folder, the one to drag last, and its size with the stack."""

    program_id: str
    files: tuple[str, ...]
    size: Size


def board_of(project: Project, name: str) -> Target:
    """Return the target called `name`, which must be a board."""
    require(project, "controller", "signals", "arithmetic")
    with located(project):
        target = load_target(name)
        if target.qemu is not None or TRANSPORT not in target.links:
            raise CodegenError(f"target {target.name} is no board: nothing can be flashed; see: firmloop targets")
        return target


def build(project: Project, target: Target, live: Path | None, folder: Path) -> Built:
    """Write the image and the file to drag into `folder`.

    The image serves `firmloop verify --port`; with a file `live`, it runs by itself and serves `firmloop monitor`.
    """
    generated = generate(project, design(project, plant_of(project) if project.plant else None), _command(project))
    with located(project):
        if live is None:
            files = firmware(generated.program, generated.bundle, target, TRANSPORT)
        else:
            files = live_firmware(generated.program, generated.bundle, target, {live.name: live_source(live)})
    image = build_image(files, target, folder)
    dragged = drag_file(target, image.elf)
    for left in folder.rglob("*"):
        if left.suffix in (".o", ".ci", ".su"):
            left.unlink()
    return Built(generated.program.id, (ELF, *([dragged.name] if dragged else [])), image.whole)


def put_there(target: Target, built: Built, folder: Path) -> str | None:
    """Flash the image that stands in `folder`; return the tool, None where the file has to be dragged.

    Raises
    ------
    ToolError
        when the tool found no board, or there is neither a tool nor a drive.
    """
    command = flash_command(target, folder / ELF)
    if command is not None:
        flash_board(command)
        return command[0]
    if len(built.files) == 1:
        raise ToolError(f"{target.name} has no drive: flash {folder / ELF} with a tool, for one: pip install pyocd")
    return None

"""Build a controller's image and put it onto a board, or say which file to drag where."""

from __future__ import annotations

from pathlib import Path

from firmloop.codegen.bundle import CodegenError
from firmloop.codegen.firmware import firmware, live_firmware
from firmloop.codegen.target import load_target
from firmloop.console import Console, progress
from firmloop.identify.simulation.compiler import ToolError
from firmloop.output import results_folder
from firmloop.project.project import Project, require
from firmloop.project.table import ProjectError
from firmloop.stages.pipeline import command_of, design, generate, located, plant_of
from firmloop.verify.build.flash import drag_file, flash_command
from firmloop.verify.build.flash import flash as flash_board
from firmloop.verify.build.image import ELF, build_image

TRANSPORT = "uart"


def flash(project: Project, name: str, live: Path | None, out: Path, console: Console) -> int:
    """Write OUT/image.elf and the file to drag, and flash the board if pyOCD or OpenOCD is here.

    The image serves `firmloop verify --port`; with a file `live`, it runs by itself and serves `firmloop monitor`.

    Raises
    ------
    ToolError
        when the image cannot be built, the tool found no board, or there is neither a tool nor a drive.
    """
    require(project, "controller", "signals", "arithmetic")
    with located(project):
        target = load_target(name)
        if target.qemu is not None or TRANSPORT not in target.links:
            raise CodegenError(f"target {target.name} is no board: nothing can be flashed; see: firmloop targets")
    with results_folder(out, ()) as folder, progress(f"building for {target.name}"):
        generated = generate(project, design(project, plant_of(project) if project.plant else None), _command(project))
        with located(project):
            if live is None:
                files = firmware(generated.program, generated.bundle, target, TRANSPORT)
            else:
                files = live_firmware(generated.program, generated.bundle, target, {live.name: _text(live)})
        image = build_image(files, target, folder)
        dragged = drag_file(target, image.elf)
        for left in folder.rglob("*"):
            if left.suffix in (".o", ".ci", ".su"):
                left.unlink()
    kept = [out / ELF, *([out / dragged.name] if dragged else [])]
    size = image.whole
    console.lines(
        [f"{target.name}: {size.text_bytes} bytes of flash, {size.data_bytes + size.bss_bytes} of RAM, stack included"]
    )
    console.result("program_id", generated.program.id)
    console.result("files", [str(path) for path in kept])
    command = flash_command(target, out / ELF)
    console.result("flashed_by", command[0] if command else None)
    if command is not None:
        with progress(f"flashing with {command[0]}"):
            flash_board(command)
        console.lines(
            [f"flashed with {command[0]}; then: firmloop verify {project.path.name} --target {name} --port ..."]
        )
    elif dragged is not None:
        console.lines([f"NOT flashed: drag {out / dragged.name} onto the board's drive; or: pip install pyocd"])
    else:
        raise ToolError(f"{target.name} has no drive: flash {out / ELF} with a tool, for one: pip install pyocd")
    return 0


def _command(project: Project) -> str:
    return command_of("flash", project.path)


def _text(path: Path) -> str:
    if path.suffix != ".c":
        raise ProjectError(f"--live {path}: must be a C file")
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise ProjectError(f"--live {path}: cannot be read: {error}") from None

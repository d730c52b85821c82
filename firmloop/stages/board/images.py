"""Link an image for every target of a project that takes one, so that judges can read its machine code."""

from __future__ import annotations

import shutil
from pathlib import Path

from firmloop.codegen.firmware import firmware
from firmloop.codegen.target import load_target
from firmloop.identify.simulation.scratch import scratch_folder
from firmloop.project.project import Project
from firmloop.stages.making import Generated
from firmloop.stages.plant import located
from firmloop.verify.build.image import build_image
from firmloop.verify.proofs.judge import IMAGES


def link_images(project: Project, generated: Generated, folder: Path) -> tuple[str, ...]:
    """Write `folder`/images/<target>.elf for each target, built as `firmloop verify` builds it; return their names.

    Raises
    ------
    ToolError
        when a compiler is missing or refuses the code.
    ProjectError
        when a target cannot hold the image.
    """
    linked = []
    for name in project.targets:
        with located(project):
            target = load_target(name)
            if target.startup is None:
                continue
            files = firmware(generated.program, generated.bundle, target, target.links[0])
            with scratch_folder(folder, "image") as scratch:
                image = build_image(files, target, scratch)
                place = folder / IMAGES / f"{target.name}.elf"
                place.parent.mkdir(exist_ok=True)
                shutil.copyfile(image.elf, place)
            linked.append(target.name)
    return tuple(linked)

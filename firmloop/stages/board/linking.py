"""Greet a controller that runs by itself: behind a port, or on an emulated core, on the two functions of a C file."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from firmloop.codegen.firmware import live_firmware
from firmloop.codegen.target import Qemu, Target
from firmloop.project.project import Project
from firmloop.project.table import ProjectError
from firmloop.stages.board.flashing import live_source
from firmloop.stages.making import Generated
from firmloop.stages.plant import located
from firmloop.stages.progress import Stage
from firmloop.verify.build.image import build_image
from firmloop.verify.links.live import LiveLink, open_live_port, start_live

NANOSECONDS = 1e9


@contextmanager
def live_link(
    project: Project, generated: Generated, target: Target, port: str | None, live: Path | None, stage: Stage
) -> Iterator[LiveLink]:
    """Give the link to the port that is named, else to an emulated core that is started here, and ends here.

    Raises
    ------
    ProjectError
        when nothing says where the controller runs, or on what.
    LinkError, ToolError, CodegenError
        when it does not answer, or the image cannot be built or started.
    """
    if port is not None:
        if live is not None:
            raise ProjectError(
                f"--live {live}: is for an emulated core, but --port {port} names a controller that runs already; "
                "leave one of the two out (to put the file onto a board: firmloop flash ... --live FILE.c)"
            )
        with open_live_port(target, port, generated.program) as link:
            yield link
        return
    if target.qemu is None:
        raise ProjectError(
            f"--port: is missing, and target {target.name} is no emulated core; name where the board is "
            "(firmloop targets --ports shows what is here), or an emulated core: --target qemu_mps2_an386 --live FILE.c"
        )
    if live is None:
        raise ProjectError(
            f"--live: is missing: on {target.name} the controller needs its two functions, in a C file that includes "
            f'"live.h": void live_read({project.name}_in_t *in) and void live_write(const {project.name}_out_t *out)'
        )
    assert target.clock_hz is not None, "only the host has none"
    paced = replace(target, qemu=_paced(target.qemu, target.clock_hz))
    with tempfile.TemporaryDirectory() as folder:
        with stage(f"starting {target.name}"), located(project):
            files = live_firmware(generated.program, generated.bundle, paced, {live.name: live_source(live)})
            elf = build_image(files, paced, Path(folder)).elf
        with start_live(paced, elf, generated.program) as link:
            yield link


def _paced(qemu: Qemu, clock_hz: int) -> Qemu:
    """Let an instruction take about a period of the core's clock, where a target counts them in coarser steps."""
    return replace(qemu, icount_shift=min(qemu.icount_shift, int(math.log2(NANOSECONDS / clock_hz))))

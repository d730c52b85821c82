"""`firmloop doctor`: what this machine has and lacks."""

from __future__ import annotations

import argparse
import platform
from dataclasses import asdict

from firmloop.console import Console, table

NAME = "doctor"
HELP = "what this machine has and lacks, with the install command"

NO_TOOL = 3


def arguments(parser: argparse.ArgumentParser) -> None:
    """Ask for nothing."""


def run(arguments: argparse.Namespace, console: Console) -> int:
    """Show what is here and what is not; status 3 if anything that is needed is not."""
    from firmloop.stages.board.machine import comforts, extras, packages, ports_refused, survey

    tools, libraries, more = survey(), packages(), (*extras(), *comforts())
    rows = [
        (tool.name, tool.version or f"MISSING: {tool.install}", f"({tool.needed_for})") for tool in (*tools, *libraries)
    ]
    rows += [(tool.name, tool.version or f"not here: {tool.install}", f"({tool.needed_for})") for tool in more]
    console.lines(table([("python", platform.python_version()), *rows]))
    console.result("python", platform.python_version())
    for key, found in (("tools", tools), ("packages", libraries), ("comforts", more)):
        console.result(key, [asdict(tool) for tool in found])
    refused = ports_refused()
    if refused:
        console.lines([f"  not allowed: {', '.join(refused)}: sudo usermod -aG dialout $USER, then log in again"])
    console.result("ports_refused", refused)
    missing = [tool.name for tool in (*tools, *libraries) if tool.version is None]
    lacking = [tool.name for tool in more if tool.version is None]
    comfort = f"; of what adds to it, not here: {', '.join(lacking)}" if lacking else ""
    console.lines([f"missing: {', '.join(missing)}" if missing else f"everything needed is here{comfort}"])
    return NO_TOOL if missing else 0

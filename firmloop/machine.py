"""Tell what can be built for, and what this machine has and lacks for it."""

from __future__ import annotations

import platform
import shutil
import subprocess
from dataclasses import asdict, dataclass
from pathlib import Path

from codegen.target import load_target, target_names
from firmloop.console import Console, table

NO_TOOL = 3


@dataclass(frozen=True, slots=True)
class Tool:
    """One program this machine has (`version`) or lacks (None); `needed_for` says who would miss it."""

    name: str
    version: str | None
    needed_for: str
    install: str


def targets(console: Console) -> int:
    """Show every target of targets/."""
    known = [load_target(name) for name in target_names()]
    console.lines(table([(target.name, target.says) for target in known]))
    console.result("targets", [{"name": target.name, "says": target.says, "core": target.core} for target in known])
    return 0


def doctor(console: Console) -> int:
    """Show what is here and what is not; status 3 if anything is not."""
    tools = survey()
    console.lines(
        table([(tool.name, tool.version or f"MISSING: {tool.install}", f"({tool.needed_for})") for tool in tools])
    )
    console.result("python", platform.python_version())
    console.result("tools", [asdict(tool) for tool in tools])
    missing = [tool.name for tool in tools if tool.version is None]
    console.lines([f"missing: {', '.join(missing)}" if missing else "everything is here"])
    return NO_TOOL if missing else 0


def survey() -> tuple[Tool, ...]:
    """Ask every program that firmloop may call for its version."""
    return (
        Tool("gcc", _version("gcc"), "fit, host verification", "apt-get install gcc libc6-dev"),
        Tool(
            "arm-none-eabi-gcc", _version("arm-none-eabi-gcc"), "Cortex-M images", "apt-get install gcc-arm-none-eabi"
        ),
        Tool("newlib", _newlib(), "Cortex-M images", "apt-get install libnewlib-arm-none-eabi"),
        Tool(
            "qemu-system-arm",
            _version("qemu-system-arm"),
            "Cortex-M runs without a board",
            "apt-get install qemu-system-arm",
        ),
    )


def _version(program: str) -> str | None:
    """Return the first line a program says about its version, None if it is not here or does not run."""
    said = _said(program, "--version")
    return said.split("\n", 1)[0].strip() or None if said is not None else None


def _newlib() -> str | None:
    """Return that the ARM compiler finds its C library; gcc names a file it does not find by its bare name."""
    said = _said("arm-none-eabi-gcc", "-print-file-name=nano.specs")
    return "found" if said is not None and Path(said.strip()).is_file() else None


def _said(program: str, option: str) -> str | None:
    path = shutil.which(program)
    if path is None:
        return None
    try:
        done = subprocess.run([path, option], capture_output=True, text=True, timeout=20, check=True)
    except (OSError, subprocess.SubprocessError, UnicodeDecodeError):
        return None
    return done.stdout

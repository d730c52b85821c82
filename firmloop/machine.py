"""Tell what can be built for, and what this machine has and lacks for it."""

from __future__ import annotations

import os
import platform
import shutil
import subprocess
from dataclasses import asdict, dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from firmloop.codegen.target import load_target, target_names
from firmloop.console import Console, table
from firmloop.verify.links.ports import boards_at, find_ports

NO_TOOL = 3
PACKAGES = (
    ("casadi", "plants and control laws"),
    ("numpy", "all arithmetic"),
    ("scipy", "fitting"),
    ("control", "margins"),
    ("jinja2", "printing C"),
    ("pyserial", "boards"),
    ("matplotlib", "figures of the report"),
    ("h5py", "MATLAB 7.3 recordings"),
    ("z3-solver", "the second proof of fixed-point ranges"),
)


@dataclass(frozen=True, slots=True)
class Tool:
    """One program or package this machine has (`version`) or lacks (None); `needed_for` says who would miss it."""

    name: str
    version: str | None
    needed_for: str
    install: str


def targets(console: Console) -> int:
    """Show every target of targets/."""
    known = [load_target(name) for name in target_names()]
    ran = {"run": "run in the tests", "built": "only built and measured in the tests"}
    console.lines(table([(target.name, target.says, ran[target.tested]) for target in known]))
    facts = [(target.name, target.says, target.core, target.tested, target.links) for target in known]
    console.result(
        "targets", [dict(zip(("name", "says", "core", "tested", "links"), fact, strict=True)) for fact in facts]
    )
    return 0


def ports(console: Console) -> int:
    """Show every serial port, and the boards that it may belong to."""
    known = [load_target(name) for name in target_names()]
    found = [(port, boards_at(port, known)) for port in find_ports()]
    console.lines(table([(port.device, port.usb or "-", port.says, ", ".join(boards)) for port, boards in found]))
    if not found:
        console.lines(["no serial port: is the board plugged in, and may you use it (group dialout)?"])
    console.result("ports", [{**asdict(port), "targets": list(boards)} for port, boards in found])
    return 0


def doctor(console: Console) -> int:
    """Show what is here and what is not; status 3 if anything that is needed is not."""
    needed, extra = (*survey(), *packages()), comforts()
    rows = [(tool.name, tool.version or f"MISSING: {tool.install}", f"({tool.needed_for})") for tool in needed]
    rows += [(tool.name, tool.version or f"not here: {tool.install}", f"({tool.needed_for})") for tool in extra]
    console.lines(table([("python", platform.python_version()), *rows]))
    console.result("python", platform.python_version())
    console.result("tools", [asdict(tool) for tool in survey()])
    console.result("packages", [asdict(tool) for tool in packages()])
    console.result("comforts", [asdict(tool) for tool in extra])
    refused = [port.device for port in find_ports() if not os.access(port.device, os.R_OK | os.W_OK)]
    if refused:
        console.lines([f"  not allowed: {', '.join(refused)}: sudo usermod -aG dialout $USER, then log in again"])
    console.result("ports_refused", refused)
    missing = [tool.name for tool in needed if tool.version is None]
    lacking = [tool.name for tool in extra if tool.version is None]
    comfort = f"; of what adds to it, not here: {', '.join(lacking)}" if lacking else ""
    console.lines([f"missing: {', '.join(missing)}" if missing else f"everything needed is here{comfort}"])
    return NO_TOOL if missing else 0


def packages() -> tuple[Tool, ...]:
    """Every Python package that firmloop imports."""
    found = []
    for name, needed_for in PACKAGES:
        try:
            here: str | None = version(name)
        except PackageNotFoundError:
            here = None
        found.append(Tool(name, here, needed_for, f"pip install {name}"))
    return tuple(found)


def comforts() -> tuple[Tool, ...]:
    """Programs without which everything still works, with less comfort."""
    return (
        Tool("make", _version("make"), "the Makefile of an image", "apt-get install make"),
        Tool("setpriv", _version("setpriv"), "ends QEMU when firmloop is killed", "apt-get install util-linux"),
        Tool("pyocd", _version("pyocd"), "flashing a board", "pip install pyocd"),
        Tool("openocd", _version("openocd"), "flashing a board, instead of pyocd", "apt-get install openocd"),
    )


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

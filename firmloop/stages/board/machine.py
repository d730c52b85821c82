"""Find out what this machine has and lacks."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from firmloop.codegen.target import load_target, target_names
from firmloop.identify.simulation.compiler import install_line
from firmloop.verify.links.ports import find_ports

PACKAGES = (
    ("casadi", "plants and control laws"),
    ("numpy", "all arithmetic"),
    ("scipy", "fitting"),
    ("jinja2", "printing C"),
    ("pyserial", "boards"),
    ("matplotlib", "figures of the report"),
    ("z3-solver", "the second proof of fixed-point ranges"),
    ("threadpoolctl", "diagnosis"),
    ("numba", "the reference of quadratic programs"),
)
EXTRAS = (
    ("asammdf", "mdf4", "MDF recordings"),
    ("distributed", "dask", "a fleet on a Dask cluster"),
    ("h5py", "hdf5", "HDF5 and MATLAB 7.3 recordings"),
    ("mcap", "mcap", "MCAP recordings"),
    ("nfoursid", "blackbox", "subspace models"),
    ("npTDMS", "tdms", "TDMS recordings"),
    ("pandas", "blackbox", "subspace models"),
    ("pyarrow", "parquet", "Parquet recordings"),
    ("pyulog", "ulog", "ULog recordings"),
    ("ray", "ray", "a fleet on a Ray cluster"),
    ("rosbags", "rosbag", "bags of ROS"),
)

NEEDED = (
    ("gcc", "fit, host verification"),
    ("arm-none-eabi-gcc", "Cortex-M images"),
    ("qemu-system-arm", "Cortex-M runs without a board"),
)


@dataclass(frozen=True, slots=True)
class Tool:
    """One program or package this machine has (`version`) or lacks (None); `needed_for` says who would miss it."""

    name: str
    version: str | None
    needed_for: str
    install: str


def packages() -> tuple[Tool, ...]:
    """Every Python package that firmloop cannot do without."""
    return tuple(Tool(name, _installed(name), needed_for, f"pip install {name}") for name, needed_for in PACKAGES)


def extras() -> tuple[Tool, ...]:
    """Every Python package that only some recordings or models need."""
    return tuple(
        Tool(name, _installed(name), needed_for, f"pip install 'firmloop[{extra}]'")
        for name, extra, needed_for in EXTRAS
    )


def _installed(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None


def comforts() -> tuple[Tool, ...]:
    """Programs without which everything still works, with less comfort."""
    return (
        Tool("make", _version("make"), "the Makefile of an image", "apt-get install make"),
        Tool("setpriv", _version("setpriv"), "ends QEMU when firmloop is killed", "apt-get install util-linux"),
        Tool("pyocd", _version("pyocd"), "flashing a board", "pip install pyocd"),
        Tool("openocd", _version("openocd"), "flashing a board, instead of pyocd", "apt-get install openocd"),
        *_of_targets(),
    )


def _of_targets() -> Iterator[Tool]:
    """Yield what single targets are built and run with, beside what most of them need."""
    known = {name for name, *_ in NEEDED}
    targets = [load_target(name) for name in target_names()]
    for target in targets:
        for name in (target.compiler, *((target.qemu.program,) if target.qemu is not None else ())):
            if name not in known:
                known.add(name)
                yield Tool(name, _version(name), f"target {target.name}", install_line(name))


def survey() -> tuple[Tool, ...]:
    """Ask every program that firmloop may call for its version."""
    programs = [Tool(name, _version(name), needed_for, install_line(name)) for name, needed_for in NEEDED]
    return (*programs, Tool("newlib", _newlib(), "Cortex-M images", "apt-get install libnewlib-arm-none-eabi"))


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


def ports_refused() -> list[str]:
    """Return the serial ports that this user may not use."""
    return [port.device for port in find_ports() if not os.access(port.device, os.R_OK | os.W_OK)]

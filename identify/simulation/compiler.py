"""Run the host's C compiler, and keep what it built in a private cache."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import tempfile
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path

from firmloop.identify.extras import ToolError as ToolError
from firmloop.identify.simulation.library_cache import find_library, keep_library
from firmloop.identify.simulation.own_folder import why_not_own
from firmloop.identify.simulation.scratch import scratch_folder

_PACKAGES = {
    "gcc": "gcc libc6-dev",
    "make": "make",
    "arm-none-eabi-gcc": "gcc-arm-none-eabi libnewlib-arm-none-eabi",
    "arm-none-eabi-size": "binutils-arm-none-eabi",
    "arm-none-eabi-nm": "binutils-arm-none-eabi",
    "arm-none-eabi-objdump": "binutils-arm-none-eabi",
    "arm-none-eabi-objcopy": "binutils-arm-none-eabi",
    "qemu-system-arm": "qemu-system-arm",
    "riscv64-unknown-elf-gcc": "gcc-riscv64-unknown-elf picolibc-riscv64-unknown-elf",
    "riscv64-unknown-elf-size": "binutils-riscv64-unknown-elf",
    "riscv64-unknown-elf-nm": "binutils-riscv64-unknown-elf",
    "picolibc.specs": "picolibc-riscv64-unknown-elf",
    "qemu-system-riscv32": "qemu-system-misc",
    "clang-format": "clang-format",
}

_SPECS = re.compile(r"cannot read spec file '([\w.-]+)'")

LONGEST_BUILD = 300.0  # s; a compiler that takes longer hangs
_SHOWN_LINES = 12  # of the compiler's words; the first error is what matters


def find_tool(name: str) -> Path:
    """Return the path of a program, or raise ToolError with the command that installs it."""
    found = shutil.which(name)
    if found is None:
        raise not_installed(name)
    return Path(found)


def not_installed(name: str) -> ToolError:
    """Return the error that names what is missing and the command that installs it."""
    install = install_line(name)
    return ToolError(f"{name} is not installed; {f'install it with: {install}' if install else 'put it on PATH'}")


def install_line(name: str) -> str:
    """Return the command that installs a program or a file of one; empty where none is known."""
    return f"apt-get install {_PACKAGES[name]}" if name in _PACKAGES else ""


def run_compiler(command: Sequence[str], folder: Path) -> str:
    """Run `command` in `folder` and return what it said; ToolError with its first lines where it failed."""
    tool = find_tool(command[0])
    # C locale: the words shown to the user, and hashed into caches, must not depend on the machine's language.
    # What a compiler that is killed leaves behind goes with the folder that it works in.
    environment = {**os.environ, "LC_ALL": "C", "TMPDIR": "."}
    try:
        done = subprocess.run(
            [str(tool), *command[1:]],
            cwd=folder,
            env=environment,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            timeout=LONGEST_BUILD,
            check=False,
        )
    except OSError as error:
        raise ToolError(f"{command[0]} could not be started ({error.strerror}); install it again") from None
    except subprocess.TimeoutExpired:
        raise ToolError(f"{command[0]} did not end within {LONGEST_BUILD:.0f} s; try again") from None
    said = done.stdout.decode(errors="replace")
    if done.returncode != 0:
        unread = _SPECS.search(said)
        if unread:  # the compiler is there, the C library that its specs come with is not
            raise not_installed(unread[1])
        first = "\n".join(said.splitlines()[:_SHOWN_LINES])
        raise ToolError(f"{command[0]} failed with status {done.returncode}:\n{first}")
    return said


def shared_library(files: Mapping[str, str], sources: Sequence[str], flags: Sequence[str]) -> Path:
    """Compile `sources` (names in `files`) into one library; what was built once is taken from the cache."""
    return built(files, sources, ("-shared", "-fPIC", *flags))


def built(files: Mapping[str, str], sources: Sequence[str], flags: Sequence[str]) -> Path:
    """Compile and link `sources` (names in `files`); what was built once is taken from the cache.

    The cache key is every text, the flags and the compiler's version. It is built in a folder of its own and renamed,
    so that two processes building the same do not disturb each other.
    """
    parts = [compiler_version("gcc"), *flags, *sources, *(f"{name}\n{text}" for name, text in sorted(files.items()))]
    key, kept = "\0".join(parts), cache_folder()
    found = find_library(kept, key)
    if found is not None:
        return found
    try:
        with scratch_folder(kept, "build") as folder:
            for relative, text in files.items():
                target = folder / relative
                target.parent.mkdir(parents=True, exist_ok=True)
                target.write_text(text, encoding="utf-8")
            run_compiler(["gcc", *flags, "-o", "library.so", *sources, "-lm"], folder)
            return keep_library(folder / "library.so", kept, key)
    except OSError as error:
        raise ToolError(
            f"{kept}: nothing can be built there ({error.strerror}); make room, or set XDG_CACHE_HOME to another folder"
        ) from None


@cache
def compiler_version(name: str) -> str:
    """First line of what the compiler says about itself."""
    return run_compiler([name, "--version"], Path.cwd()).partition("\n")[0]


def cache_folder() -> Path:
    """Return a folder that only this user can write: under $XDG_CACHE_HOME, else under the temporary folder."""
    base = os.environ.get("XDG_CACHE_HOME", "")
    if os.path.isabs(base):  # the XDG Base Directory Specification has others ignored
        folder = Path(base) / "firmloop"
    else:
        user = os.getuid() if hasattr(os, "getuid") else "cache"
        folder = Path(tempfile.gettempdir()) / f"firmloop-{user}"  # never the package's own name, which it would hide
    try:
        for missing in reversed([place for place in (folder, *folder.parents) if not os.path.lexists(place)]):
            missing.mkdir(mode=0o700, exist_ok=True)
        # Libraries in it are loaded and run: nobody else may have put them there.
        fault = why_not_own(folder)
    except OSError as error:
        fault = f"{folder} cannot be made ({error.strerror})"
    if fault:
        raise ToolError(f"{fault}: nothing may be built in {folder}; set XDG_CACHE_HOME to a folder of yours")
    return folder

"""Build the image of a controller, and measure what it occupies."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from firmloop.codegen.bundle import CodegenError, write_files
from firmloop.codegen.firmware import LINK_FLAGS, compile_flags
from firmloop.codegen.target import Target
from firmloop.identify.simulation.compiler import ToolError, compiler_version, run_compiler
from firmloop.verify.build.start import check_start
from firmloop.verify.verdict import Function

ELF = "image.elf"
CONTROLLER = "controller/"  # where firmware() puts the controller's own files
OWN_STACK = 512  # bytes, what the image takes above step(), with room to spare
RUN_TIME_STACK = 128  # bytes, what a run-time function of the compiler takes at most, such as one that adds floats
# Double precision: run-time ABI for Arm (IHI 0043), section 4.1.2; elsewhere libgcc's own names, whose mode is DF.
DOUBLE_HELPER = re.compile(r"__aeabi_(d\w+|\w+2d)|__[a-z]+df[a-z0-9]*")

_NODE = re.compile(r'node: \{ title: "([^"]*)" label: "([^"]*)"')
_EDGE = re.compile(r'edge: \{ sourcename: "([^"]*)" targetname: "([^"]*)"')
_OVERFLOW = re.compile(r"region `(\w+)' overflowed by (\d+) bytes")
_FRAME = re.compile(r"(\d+) bytes \(static\)")


@dataclass(frozen=True, slots=True)
class Size:
    """Bytes of code and constants, of initialized data, and of zeroed data."""

    text_bytes: int
    data_bytes: int
    bss_bytes: int


@dataclass(frozen=True, slots=True)
class Image:
    """A built image."""

    elf: Path
    compiler: str  # what it says of its version
    flags: tuple[str, ...]  # compile and link
    controller: Size  # of the controller's own object files, without instance memory, which is the caller's
    whole: Size
    stack_bytes: int | None  # of step() and all it calls; None where a callee's is not known, as with soft float
    double_helpers: tuple[str, ...]  # run-time functions for double precision that were linked
    functions: tuple[Function, ...]  # of the controller, as compiled: what was inlined is in its caller


def build_image(files: Mapping[str, str], target: Target, folder: Path) -> Image:
    """Write the files of one image into `folder`, compile and link them there.

    Raises
    ------
    ToolError
        when the cross compiler is missing or refuses the code.
    CodegenError
        when the target's memory cannot hold the image, or its stack what step() needs.
    """
    write_files(files, folder)
    sources = [name for name in files if name.endswith(".c")]
    flags = compile_flags(target)
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        objects = list(pool.map(lambda source: _compile(target.compiler, flags, source, folder), sources))
    _link([target.compiler, *flags, *objects, *LINK_FLAGS, "-o", ELF], target, folder)
    check_start(folder / ELF, target)
    own = [name for name in objects if name.startswith(CONTROLLER)]
    graph = "\n".join((folder / name).with_suffix(".ci").read_text() for name in own)
    _check_stack(stack_of(graph, "_step", RUN_TIME_STACK), target)
    return Image(
        elf=folder / ELF,
        compiler=compiler_version(target.compiler),
        flags=(*flags, *LINK_FLAGS),
        controller=_sum(_sizes(target.compiler, own, folder)),
        whole=_sum(_sizes(target.compiler, [ELF], folder)),
        stack_bytes=stack_of(graph, "_step"),
        double_helpers=_double_helpers(target.compiler, folder),
        functions=_functions(target.compiler, own, folder, graph),
    )


def _link(command: Sequence[str], target: Target, folder: Path) -> None:
    """Link the image; CodegenError with both numbers where a memory cannot hold it."""
    try:
        run_compiler(command, folder)
    except ToolError as error:
        beyond = {name: int(excess) for name, excess in _OVERFLOW.findall(str(error))}
        sizes = {region.name: region.size for region in target.memory}
        if not beyond:
            raise
        needs = " and ".join(
            f"{sizes[name] + beyond[name]} bytes of {name}, which has {sizes[name]}" for name in beyond
        )
        raise CodegenError(
            f"target {target.name}: the image needs {needs}; make the controller smaller (a predictive one: a shorter "
            "horizon, or moves held longer) or choose a larger part"
        ) from None


def _check_stack(needed: int | None, target: Target) -> None:
    if needed is None or target.stack_bytes is None or needed + OWN_STACK <= target.stack_bytes:
        return
    ram = next(region.size for region in target.memory if region.name == "ram")
    remedy = "raise it in the target's file" if needed + OWN_STACK < ram else "make the controller smaller"
    raise CodegenError(
        f"target {target.name}: step() needs {needed} bytes of stack and the image {OWN_STACK} more, "
        f"but stack_bytes = {target.stack_bytes} of {ram} bytes of RAM: {remedy} or choose a larger part"
    )


def stack_of(graph: str, suffix: str, run_time: int | None = None) -> int | None:
    """Return the deepest stack in bytes below the function whose name ends in `suffix`.

    `graph` is what gcc's -fcallgraph-info=su writes. The answer is None where it cannot be known from there: a callee
    that was compiled elsewhere, a frame whose size is not fixed, or recursion. A run-time function of the compiler is
    such a callee too, unless it is given what those take at most, `run_time`.
    """
    labels = dict(_NODE.findall(graph))
    frames = {title: _FRAME.search(label) for title, label in labels.items()}
    calls: dict[str, list[str]] = {}
    for caller, callee in _EDGE.findall(graph):
        calls.setdefault(caller, []).append(callee)

    def depth(function: str, above: tuple[str, ...]) -> int | None:
        frame = frames.get(function)
        if frame is None and labels.get(function, "").endswith("<built-in>"):
            return run_time
        if frame is None or function in above:
            return None
        below = [depth(callee, (*above, function)) for callee in calls.get(function, [])]
        if any(bytes_below is None for bytes_below in below):
            return None
        return int(frame.group(1)) + max((b for b in below if b is not None), default=0)

    entries = [title for title in frames if title.endswith(suffix)]
    return depth(entries[0], ()) if len(entries) == 1 else None


def _compile(compiler: str, flags: Sequence[str], source: str, folder: Path) -> str:
    output = f"{source.removesuffix('.c')}.o"
    # Whatever a file's name ends in or holds, it is C, and "./" keeps it from being an option.
    run_compiler([compiler, *flags, "-fcallgraph-info=su", "-x", "c", "-c", f"./{source}", "-o", output], folder)
    return output


def _binutil(compiler: str, tool: str) -> str:
    """Return the name of a tool of the same toolchain: arm-none-eabi-gcc has arm-none-eabi-size."""
    return f"{compiler.rpartition('gcc')[0]}{tool}"


def _sizes(compiler: str, names: Sequence[str], folder: Path) -> list[Size]:
    # Berkeley format: text data bss dec hex filename
    lines = run_compiler([_binutil(compiler, "size"), "-B", *names], folder).splitlines()[1:]
    return [Size(*(int(field) for field in line.split()[:3])) for line in lines]


def _sum(sizes: Sequence[Size]) -> Size:
    return Size(
        sum(size.text_bytes for size in sizes),
        sum(size.data_bytes for size in sizes),
        sum(size.bss_bytes for size in sizes),
    )


def _functions(compiler: str, names: Sequence[str], folder: Path, graph: str) -> tuple[Function, ...]:
    # nm -S: value size type name, in hexadecimal
    lines = (line.split() for line in run_compiler([_binutil(compiler, "nm"), "-S", *names], folder).splitlines())
    sized = [(found[3], int(found[1], 16)) for found in lines if len(found) == 4 and found[2] in "tT"]
    return tuple(Function(name, size, stack_of(graph, name)) for name, size in sorted(sized))


def _double_helpers(compiler: str, folder: Path) -> tuple[str, ...]:
    lines = run_compiler([_binutil(compiler, "nm"), ELF], folder).splitlines()
    return tuple(sorted({line.split()[-1] for line in lines if line and DOUBLE_HELPER.fullmatch(line.split()[-1])}))

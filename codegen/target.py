"""A Target: what one board, emulator or host is, read from one TOML file and checked."""

from __future__ import annotations

import os
import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import resources
from importlib.resources.abc import Traversable
from pathlib import Path

from firmloop.codegen.bundle import CodegenError
from firmloop.codegen.toml_table import TomlTable
from firmloop.codegen.toolchain import COMPILERS, EMULATORS, SOURCE_RULE, is_source_name
from firmloop.identify.regular_file import read_text

FLOAT_UNITS = ("float32", "float64")
CYCLE_TIMERS = ("dwt", "systick")  # run at the processor's clock
INTERRUPTS = 480  # of a nested vectored interrupt controller at most
DRAGGED = ("bin", "hex", "uf2")
TESTED = ("run", "built")  # its images run in the test suite; they are only compiled, linked and measured there


@dataclass(frozen=True, slots=True)
class MemoryRegion:
    """A stretch of memory; `start` is an address, `size` in bytes."""

    name: str
    start: int
    size: int


@dataclass(frozen=True, slots=True)
class Uart:
    """A UART; `driver` names templates_c/uart/uart_<driver>.c.

    With an `interrupt`, which a byte that comes raises, an image sleeps until then: templates_c/uart/wait_<driver>.c.
    """

    driver: str
    base: int
    baud: int
    clock_hz: int
    interrupt: int | None = None  # its number at the interrupt controller


@dataclass(frozen=True, slots=True)
class Timer:
    """A counter of the board's clock, `bits` wide as its driver reads it.

    `driver` names templates_c/board/timer_<driver>.c.
    """

    driver: str
    base: int
    bits: int


@dataclass(frozen=True, slots=True)
class Qemu:
    """How QEMU stands in for the board; one instruction takes 2**icount_shift ns of its virtual time."""

    machine: str
    icount_shift: int
    program: str = EMULATORS[0]


@dataclass(frozen=True, slots=True)
class RegisterWrite:
    """A register to change before anything else runs, such as a clock gate: value = value & ~clear | set.

    Then the image waits until the bits of `wait` are set in it.
    """

    address: int
    clear: int
    set: int
    says: str
    wait: int = 0


@dataclass(frozen=True, slots=True)
class Flash:
    """How an image gets onto the board: what the two tools call the part, and the file to drag onto its drive."""

    pyocd: str | None
    openocd: tuple[str, ...]  # configuration files that come with OpenOCD
    drag: str | None  # its ending, one of DRAGGED


@dataclass(frozen=True, slots=True)
class Target:
    """Where a controller can run. Fields that only an image needs are None on a host, which links a library."""

    name: str
    says: str
    core: str
    compiler: str
    flags: tuple[str, ...]
    float_units: tuple[str, ...]  # number types the hardware computes in
    links: tuple[str, ...]  # the first is the default
    tested: str
    clock_hz: int | None
    stack_bytes: int | None
    startup: str | None
    memory: tuple[MemoryRegion, ...]
    uart: Uart | None
    timer: Timer | None
    qemu: Qemu | None
    setup: tuple[RegisterWrite, ...]
    boot: str | None  # a second stage of a boot ROM: templates_c/board/boot_<boot>.c
    usb: tuple[str, ...]  # vendor:product of the ports that such a board shows
    flash: Flash | None
    sources: tuple[tuple[str, str], ...]  # C files of the user, which stand beside the target's own: name and text

    @property
    def counts_cycles(self) -> bool:
        """Whether its timer counts the cycles of a real processor; an emulator's says nothing of them."""
        return self.qemu is None and self.timer is not None and self.timer.driver in CYCLE_TIMERS


def target_names() -> tuple[str, ...]:
    """Names of the targets that come with firmloop, sorted."""
    files = resources.files("firmloop").joinpath("targets").iterdir()
    return tuple(sorted(file.name.removesuffix(".toml") for file in files if file.name.endswith(".toml")))


def load_target(name: str) -> Target:
    """Read the target `name`, or the file that `name` is the path of when it ends in `.toml`.

    Raises
    ------
    CodegenError
        when there is none, or its file is not a correct description of a target.
    """
    if name.endswith(".toml"):
        path = Path(name)
        try:
            text = read_text(path)
        except (OSError, UnicodeDecodeError) as error:
            raise CodegenError(f"target file {name} cannot be read: {error}") from None
        return parse_target(text, path.name, path.parent)
    if name not in target_names():
        raise CodegenError(
            f"target {name!r} is unknown; known: {', '.join(target_names())}; or give the path of a .toml file"
        )
    folder = resources.files("firmloop").joinpath("targets")
    return parse_target(folder.joinpath(f"{name}.toml").read_text(encoding="utf-8"), f"{name}.toml", folder)


def board_parts(kind: str) -> tuple[str, ...]:
    """Names for which there is a C file <kind>_<name>.c of an image, sorted."""
    found = (re.fullmatch(rf"{kind}_(\w+)\.c", file) for file in part_files())
    return tuple(sorted(match.group(1) for match in found if match))


def part_files() -> Mapping[str, str]:
    """Return the place under templates_c/ of every file that the board/ of an image may hold, by its name."""
    root = resources.files("firmloop").joinpath("templates_c")
    return {file.name: f"{part}/{file.name}" for part in ("board", "uart") for file in root.joinpath(part).iterdir()}


def parse_target(text: str, file: str, folder: Traversable) -> Target:
    """Check the text of a target's file.

    `file` is its name, whose stem must be the target's; `folder` is where its sources are.
    """
    try:
        table = TomlTable(tomllib.loads(text), file, "")
    except tomllib.TOMLDecodeError as error:
        raise CodegenError(f"{file}: not TOML: {error}") from None
    links = table.choices("links", ("library", *board_parts("transport")))
    if not links:
        raise table.wrong("links", [], "names at least one link")
    hosted = links == ("library",)
    if "library" in links and not hosted:
        raise table.wrong("links", list(links), "is ['library'] alone on a host, or does not name 'library'")
    name = table.word("name")
    if name != Path(file).stem:
        raise table.wrong("name", name, f"must be the name of its file, {Path(file).stem!r}")
    clock = None if hosted else table.integer("clock_hz", 1, 2**32 - 1)
    target = Target(
        name=name,
        says=table.phrase("says"),
        core=table.word("core"),
        compiler=table.choice("compiler", COMPILERS),
        flags=table.compiler_flags("flags"),
        float_units=table.choices("float_units", FLOAT_UNITS),
        links=links,
        tested=table.choice("tested", TESTED),
        clock_hz=clock,
        stack_bytes=None if hosted else table.integer("stack_bytes", 256, 2**24),
        startup=None if hosted else table.choice("startup", board_parts("startup")),
        memory=() if hosted else tuple(_region(entry) for entry in table.tables("memory")),
        uart=_uart(table.table("uart"), clock) if clock and (table.has("uart") or "uart" in links) else None,
        timer=None if hosted else _timer(table.table("timer")),
        qemu=_qemu(table.table("qemu")) if table.has("qemu") or "semihosting" in links else None,
        setup=tuple(_register_write(entry) for entry in table.tables("setup")) if table.has("setup") else (),
        boot=table.choice("boot", board_parts("boot")) if table.has("boot") else None,
        usb=table.usb_ids("usb") if table.has("usb") else (),
        flash=_flash(table.table("flash")) if table.has("flash") else None,
        sources=_sources(table, folder) if table.has("sources") else (),
    )
    table.finish()
    _check_memory(target, table)
    _check_semihosting(target, table)
    return target


def _region(table: TomlTable) -> MemoryRegion:
    region = MemoryRegion(
        table.identifier("name"), table.integer("start", 0, 2**32 - 1), table.integer("bytes", 64, 2**32 - 1)
    )
    table.finish()
    return region


def _uart(table: TomlTable, board_clock: int) -> Uart:
    uart = Uart(
        driver=table.choice("driver", board_parts("uart")),
        base=table.integer("base", 0, 2**32 - 1),
        baud=table.integer("baud", 1200, 12_000_000),
        clock_hz=table.integer("clock_hz", 1, 2**32 - 1) if table.has("clock_hz") else board_clock,
        interrupt=table.integer("interrupt", 0, INTERRUPTS - 1) if table.has("interrupt") else None,
    )
    if uart.interrupt is not None and uart.driver not in board_parts("wait"):
        rule = f"is of no use to driver {uart.driver!r}, which asks for bytes again and again: leave it out"
        raise table.wrong("interrupt", uart.interrupt, rule)
    table.finish()
    return uart


def _timer(table: TomlTable) -> Timer:
    timer = Timer(
        driver=table.choice("driver", board_parts("timer")),
        base=table.integer("base", 0, 2**32 - 1),
        bits=table.integer("bits", 16, 32),
    )
    table.finish()
    return timer


def _qemu(table: TomlTable) -> Qemu:
    # QEMU takes shifts up to 10; below 0 there are none.
    qemu = Qemu(
        machine=table.word("machine"),
        icount_shift=table.integer("icount_shift", 0, 10),
        program=table.choice("program", EMULATORS) if table.has("program") else EMULATORS[0],
    )
    table.finish()
    return qemu


def _register_write(table: TomlTable) -> RegisterWrite:
    write = RegisterWrite(
        address=table.integer("address", 0, 2**32 - 4),
        clear=table.integer("clear", 0, 2**32 - 1) if table.has("clear") else 0,
        set=table.integer("set", 0, 2**32 - 1) if table.has("set") else 0,
        says=table.phrase("says"),
        wait=table.integer("wait", 0, 2**32 - 1) if table.has("wait") else 0,
    )
    table.finish()
    return write


def _flash(table: TomlTable) -> Flash:
    flash = Flash(
        pyocd=table.word("pyocd") if table.has("pyocd") else None,
        openocd=table.places("openocd") if table.has("openocd") else (),
        drag=table.choice("drag", DRAGGED) if table.has("drag") else None,
    )
    table.finish()
    return flash


def _sources(table: TomlTable, folder: Traversable) -> tuple[tuple[str, str], ...]:
    own = part_files()
    texts = []
    for name in table.places("sources"):
        file = folder.joinpath(name)
        if not is_source_name(name):
            raise table.wrong("sources", name, SOURCE_RULE)
        if name in own:
            raise table.wrong("sources", name, "is the name of a part of firmloop's own: give the file another name")
        if isinstance(file, Path) and os.path.dirname(os.path.realpath(file)) != os.path.realpath(file.parent):
            raise table.wrong("sources", name, "is a link out of the target's folder: put the file itself there")
        if isinstance(file, Path) and file.exists() and not file.is_file():
            raise table.wrong("sources", name, "is no regular file: put the C text there")
        try:
            texts.append((name, read_text(file) if isinstance(file, Path) else file.read_text(encoding="utf-8")))
        except (OSError, UnicodeDecodeError) as error:
            raise table.wrong("sources", name, f"cannot be read: {error}") from None
    return tuple(texts)


def _check_memory(target: Target, table: TomlTable) -> None:
    if target.stack_bytes is None:
        return
    regions = {region.name: region for region in target.memory}
    if len(regions) != len(target.memory) or not {"flash", "ram"} <= set(regions):
        raise table.wrong("memory", [region.name for region in target.memory], "names 'flash' and 'ram', each once")
    if target.stack_bytes % 8 or target.stack_bytes >= regions["ram"].size:
        raise table.wrong("stack_bytes", target.stack_bytes, "is a multiple of 8 and smaller than the region 'ram'")


def _check_semihosting(target: Target, table: TomlTable) -> None:
    # Semihosting gives an image the files and the shell of this machine: nothing but our own code may run there.
    if "semihosting" not in target.links:
        return
    for key, asked in (("sources", target.sources), ("setup", target.setup)):
        if asked:
            names = [link for link in target.links if link != "semihosting"] or ["uart"]
            rule = f"semihosting lets an image reach this machine's files, so it goes without {key!r}; write {names}"
            raise table.wrong("links", list(target.links), rule)

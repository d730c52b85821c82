"""Put a controller, a board and a transport together into all the files of one image."""

from __future__ import annotations

from collections.abc import Mapping

from firmloop.codegen.bundle import Bundle, CodegenError
from firmloop.codegen.environment import render, text_of
from firmloop.codegen.target import MemoryRegion, Target, board_parts, part_files
from firmloop.codegen.toolchain import is_source_name
from firmloop.quantize.program import Program, Value

PROTOCOL_VERSION = 2
STEPS_MOST = 64  # per frame; more gains little and delays the answer to a repeated request
LIVE_SAMPLES = 64  # that wait for the line; more only delay the moment a slow line is noticed
LIVE_BATCH = 4  # in one message: its sealing is what a step may have to wait for
LEAST_TICKS = 100  # of a period; the loop that waits for it takes some
MEMBERS_MOST = 32  # bits of the word that chooses them
RAM_SHARE = 4  # the line's two buffers may take one part in so many of the board's memory

WARNINGS = (
    "-Wall",
    "-Wextra",
    "-Wpedantic",
    "-Wconversion",
    "-Wsign-conversion",
    "-Wshadow",
    "-Wdouble-promotion",
    "-Werror",
)
IMAGE_FLAGS = (
    "-std=c99",
    "-O2",
    "-ffreestanding",
    "-fbuiltin",  # -ffreestanding would call a function for sqrtf where the core has an instruction
    "-fno-math-errno",  # the same: no call to set an errno that nobody reads
    "-ffunction-sections",
    "-fdata-sections",
    "-ffp-contract=off",  # the reference rounds after every operation
    "-fno-move-loop-stores",  # gcc 12 repeats stores to device registers at the end of a loop
)
LINK_FLAGS = ("-nostdlib", "-T", "link.ld", "-Wl,--gc-sections")


def firmware(program: Program, bundle: Bundle, target: Target, transport: str) -> Mapping[str, str]:
    """Return every file of the image that serves this controller on `target` over `transport`, by relative path.

    The controller's own files are under controller/, unchanged.

    Raises
    ------
    CodegenError
        when the target has no such link or its memory cannot hold the line's buffers.
    """
    if transport == "library" or transport not in target.links:
        raise CodegenError(
            f"target {target.name} has no link {transport!r} for an image; it has: {', '.join(target.links)}"
        )
    sources = {"main.c": render("main.c.j2", _heading(program, target) | _main_view(program, bundle, target))}
    return _image(program, bundle, target, transport, sources, {})


def live_firmware(program: Program, bundle: Bundle, target: Target, own: Mapping[str, str]) -> Mapping[str, str]:
    """Return every file of the image that runs this controller at its period and tells over the UART what it does.

    `own` are the user's C files by name, which stand beside live.h and define the two functions of live.h.

    Raises
    ------
    CodegenError
        when the target has no UART, or its clock cannot time the period.
    """
    for name in own:
        if not is_source_name(name):
            raise CodegenError(
                f"the file of yours is called {name!r}: rename it to letters, digits and '_', ending in .c"
            )
    if "live.c" in own:
        raise CodegenError("the file of yours is called live.c, as the image's own is: give it another name")
    if "uart" not in target.links:
        raise CodegenError(f"target {target.name} has no UART to watch it by; it has: {', '.join(target.links)}")
    view = _heading(program, target) | _main_view(program, bundle, target) | _live_view(program, bundle, target)
    sources = {"live.c": render("live.c.j2", view), **own}
    return _image(program, bundle, target, "uart", sources, {"live.h": render("live.h.j2", view)})


def _heading(program: Program, target: Target) -> dict[str, object]:
    return {"name": program.name, "program_id": program.id, "target": target.name}


def _image(
    program: Program,
    bundle: Bundle,
    target: Target,
    transport: str,
    own_sources: Mapping[str, str],
    own_headers: Mapping[str, str],
) -> Mapping[str, str]:
    heading = _heading(program, target)
    setup = {"board/setup.c": render("board/setup.c.j2", heading | _setup_view(target))} if target.setup else {}
    sources = {
        **own_sources,
        "support/frame.c": text_of("support/frame.c"),
        **{f"board/{part}.c": text_of(part_files()[f"{part}.c"]) for part in _board_parts(target, transport)},
        **setup,
        **{f"board/{name}": text for name, text in target.sources},
        **{f"controller/{name}": bundle.files[name] for name in bundle.sources},
    }
    headers = {
        **own_headers,
        "support/frame.h": text_of("support/frame.h"),
        "board/board.h": text_of("board/board.h"),
        "board/board_config.h": render("board/board_config.h.j2", heading | {"figures": _figures(target)}),
        **{f"controller/{name}": bundle.files[name] for name in bundle.headers},
    }
    makefile = heading | _makefile_view(target, tuple(sources), tuple(headers))
    return {
        **sources,
        **headers,
        "link.ld": render("link.ld.j2", heading | _link_view(program, target)),
        "Makefile": render("Makefile.j2", makefile),
    }


def compile_flags(target: Target) -> tuple[str, ...]:
    """Return the flags every file of the image is compiled and linked with."""
    return (*IMAGE_FLAGS, *WARNINGS, *target.flags)


def _board_parts(target: Target, transport: str) -> tuple[str, ...]:
    assert target.timer is not None and target.startup is not None and transport in board_parts("transport")
    parts = ["start", f"startup_{target.startup}", f"timer_{target.timer.driver}", f"transport_{transport}"]
    if target.boot is not None:
        parts.append(f"boot_{target.boot}")
    if target.uart is not None and transport == "uart":
        parts.append(f"uart_{target.uart.driver}")
        parts.append("wait_poll" if target.uart.interrupt is None else f"wait_{target.uart.driver}")
    return tuple(parts)


def _main_view(program: Program, bundle: Bundle, target: Target) -> dict[str, object]:
    name = program.name
    return {
        "protocol": PROTOCOL_VERSION,
        "steps_max": _steps_max(program, target),
        "header": f"{name}.h",
        "state_type": f"{name}_t",
        "in_type": f"{name}_in_t",
        "out_type": f"{name}_out_t",
        "init": f"{name}_init",
        "step": f"{name}_step",
        "program_id_macro": f"{name.upper()}_PROGRAM_ID",
        "setup": bool(target.setup),
        "setters": bundle.setters,
    }


def _live_view(program: Program, bundle: Bundle, target: Target) -> dict[str, object]:
    assert target.clock_hz is not None
    ticks = round(program.period * target.clock_hz)
    if not LEAST_TICKS <= ticks < 2**31:
        raise CodegenError(
            f"target {target.name}: {program.period:g} s are {ticks} ticks of its clock; "
            f"it can time {LEAST_TICKS} to 2^31"
        )
    parameters = [
        {"number": str(k), "name": value.name, "member": f"set_{value.name}", "type": kind, "setter": setter}
        for k, (value, (kind, setter)) in enumerate(zip(program.parameters, bundle.setters, strict=True))
    ]
    names = [value.name for value in (*program.inputs, *program.outputs, *program.parameters)]
    for name in names:
        if names.count(name) > 1:
            raise CodegenError(f"two members of {program.name} are called {name!r}: rename one to watch them apart")
    members = [f"in.{value.name}" for value in program.inputs] + [f"out.{value.name}" for value in program.outputs]
    members += [parameter["member"] for parameter in parameters]
    if len(members) + 1 > MEMBERS_MOST:
        raise CodegenError(
            f"{program.name} has {len(members)} inputs, outputs and tunable parameters; "
            f"{MEMBERS_MOST - 1} can be watched"
        )
    sample = _bytes(program.inputs) + _bytes(program.outputs) + _bytes(program.parameters) + 8
    ram = next(region.size for region in target.memory if region.name == "ram")
    return {
        "period_ticks": ticks,
        "members": [*members, "status"],
        "member_count": len(members) + 1,
        "parameters": parameters,
        "samples": max(2 * LIVE_BATCH, min(LIVE_SAMPLES, ram // RAM_SHARE // sample)),
        "batch": LIVE_BATCH,
    }


def _setup_view(target: Target) -> dict[str, object]:
    return {
        "setup": [
            {
                "address": f"{w.address:#010x}U",
                "cleared": f"{w.clear:#010x}U",
                "added": f"{w.set:#010x}U",
                "awaited": f"{w.wait:#010x}U",
                "says": w.says,
            }
            for w in target.setup
        ],
    }


def _bytes(values: tuple[Value, ...]) -> int:
    return sum(value.number.bits // 8 for value in values)


def _steps_max(program: Program, target: Target) -> int:
    ram = next(region.size for region in target.memory if region.name == "ram")
    step = _bytes(program.inputs + program.parameters) + _bytes(program.outputs) + 8  # and status and ticks
    room = min(ram // RAM_SHARE, 2**16)  # a message's length is 16 bits
    if room < step + 256:
        raise CodegenError(
            f"target {target.name}: a quarter of its {ram} bytes of RAM cannot hold one step of {program.name} "
            f"({step} bytes): give the region 'ram' its true size or choose a larger part"
        )
    return min(STEPS_MOST, (room - 256) // step)


def _figures(target: Target) -> list[dict[str, str]]:
    assert target.timer is not None
    figures = [
        ("BOARD_CLOCK_HZ", f"{target.clock_hz}U", "Hz"),
        ("BOARD_TIMER_BASE", f"{target.timer.base:#010x}U", "address of the timer"),
        ("BOARD_TIMER_MASK", f"{2**target.timer.bits - 1:#010x}U", f"the timer is {target.timer.bits} bits wide"),
    ]
    if target.uart is not None:
        figures += [
            ("BOARD_UART_BASE", f"{target.uart.base:#010x}U", "address of the UART"),
            ("BOARD_UART_CLOCK_HZ", f"{target.uart.clock_hz}U", "Hz, what the baud rate is divided from"),
            ("BOARD_UART_BAUD", f"{target.uart.baud}U", "bit/s"),
        ]
        if target.uart.interrupt is not None:
            figures.append(
                ("BOARD_UART_INTERRUPT", f"{target.uart.interrupt}U", "its number at the interrupt controller")
            )
    return [{"name": name, "value": value, "says": says} for name, value, says in figures]


def _link_view(program: Program, target: Target) -> dict[str, object]:
    # The C library is asked for one thing only: the square root of a core that has no instruction for it.
    square_root = any("sqrt" in op.function for op in program.body)
    return {
        "libraries": "-lm -lc -lgcc" if square_root else "-lgcc",
        "memory": [_region_view(region) for region in target.memory],
        "stack_bytes": target.stack_bytes,
    }


def _region_view(region: MemoryRegion) -> dict[str, str]:
    access = "rx" if region.name == "flash" else "rwx"
    return {"name": region.name, "access": access, "start": f"{region.start:#010x}", "size": str(region.size)}


def _makefile_view(target: Target, sources: tuple[str, ...], headers: tuple[str, ...]) -> dict[str, object]:
    return {
        "compiler": target.compiler,
        "compile_flags": " ".join(compile_flags(target)),
        "link_flags": " ".join(LINK_FLAGS),
        "objects": " ".join(f"{source.removesuffix('.c')}.o" for source in sources),
        "headers": " ".join(headers),
    }

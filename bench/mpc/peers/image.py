"""Build a controller into an image for the Cortex-M4F, run it over recorded states, and weigh it."""

from __future__ import annotations

import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from firmloop.codegen.target import load_target
from firmloop.verify.build.image import DOUBLE_HELPER

HERE = Path(__file__).parent
TARGET = "qemu_mps2_an386"
SHIFT = 8  # 256 ns an instruction, 6.4 ticks of 40 ns
TICKS = 2**SHIFT * 25e6 / 1e9  # of an instruction
MOST = 3e9  # instructions of one run: a peer that takes more is stopped after the step that crosses it
PATIENCE = 900  # seconds of one run, for a single step that does not end


@dataclass(frozen=True)
class Parts:
    """What a peer is made of: `adapter` is ours and defines peer_start() and peer_step()."""

    adapter: str
    sources: tuple[Path, ...]
    folders: tuple[Path, ...]  # of headers
    flags: tuple[str, ...] = ()  # beside -O2 and the core's
    language: str = "c"


@dataclass(frozen=True)
class Run:
    """What a run gave and took, one entry a step that was run."""

    moves: np.ndarray
    solved: np.ndarray  # what the controller says of itself
    instructions: np.ndarray
    flash: int  # bytes, of code, constants and initialized data
    ram: int  # bytes: data, heap and the stack that was touched
    helpers: tuple[str, ...]  # functions for double precision that were linked
    mallocs: int  # calls in all steps
    malloc_linked: bool


def run(parts: Parts, states: np.ndarray, bare: tuple[int, int], folder: Path) -> Run:
    """Build `parts` in `folder` and run it over `states` (steps, n); its sizes are those above `bare`."""
    elf = _build(parts, states, folder)
    lines = [line.split() for line in _emulate(elf).splitlines()]
    rows = np.array([[int(field, 16) for field in line] for line in lines if len(line) == 3], np.int64).reshape(-1, 3)
    ends = [[int(field, 16) for field in line] for line in lines if len(line) == 4]
    stack, heap, mallocs, _ = ends[0] if ends else (0, 0, 0, 0)
    flash, static = _sizes(elf)
    names = _names(elf)
    return Run(
        moves=rows[:, 0].astype(np.uint32).view(np.float32).astype(np.float64),
        solved=rows[:, 1] != 0,
        instructions=np.rint(rows[:, 2] / TICKS).astype(np.int64),
        flash=flash - bare[0],
        ram=static - bare[1] + heap + stack,
        helpers=tuple(sorted(name for name in names if DOUBLE_HELPER.fullmatch(name))),
        mallocs=mallocs,
        malloc_linked="_malloc_r" in names,
    )


def bare_sizes(states: np.ndarray, folder: Path) -> tuple[int, int]:
    """Return flash and static data of an image whose controller does nothing, in bytes."""
    nothing = "void peer_start(void) {}\nint peer_step(const float *state, float *move) { *move = *state; return 1; }\n"
    return _sizes(_build(Parts(nothing, (), ()), states, folder))


def _build(parts: Parts, states: np.ndarray, folder: Path) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    steps, n = states.shape
    rows = ",\n".join("{" + ", ".join(f"{x!s}f" for x in row) + "}" for row in states.tolist())
    (folder / "states.h").write_text(
        f"#define STEPS {steps}\n#define STATES {n}\n#define MOST_TICKS {MOST * TICKS:.0f}ULL\n"
        f"static const float states[STEPS][STATES] = {{\n{rows}}};\n"
    )
    ending = "c" if parts.language == "c" else "cpp"
    adapter = folder / f"adapter.{ending}"
    adapter.write_text(parts.adapter)
    core = load_target(TARGET).flags
    common = [*core, "-O2", "-ffunction-sections", "-fdata-sections", "-w"]
    _call(["arm-none-eabi-gcc", *common, f"-I{folder}", "-c", str(HERE / "harness.c"), "-o", "harness.o"], folder)
    compiler = "arm-none-eabi-gcc" if parts.language == "c" else "arm-none-eabi-g++"
    headers = [f"-I{place}" for place in (folder, *parts.folders)]
    objects = ["harness.o"]
    for k, source in enumerate([adapter, *parts.sources]):
        objects.append(f"part_{k}.o")
        _call([compiler, *common, *parts.flags, *headers, "-c", str(source), "-o", objects[-1]], folder)
    linking = ["-nostartfiles", "-T", str(HERE / "harness.ld"), "-Wl,--gc-sections,--wrap=malloc", "-specs=nosys.specs"]
    _call([compiler, *core, *objects, *linking, "-lm", "-o", "image.elf"], folder)
    return folder / "image.elf"


def _emulate(elf: Path) -> str:
    command = ["qemu-system-arm", "-M", "mps2-an386", "-display", "none", "-monitor", "none", "-serial", "none"]
    command += ["-semihosting-config", "enable=on,target=native", "-icount", f"shift={SHIFT}", "-kernel", str(elf)]
    try:
        return subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE, check=False).stdout
    except subprocess.TimeoutExpired as stopped:
        return (stopped.stdout or b"").decode()


def _sizes(elf: Path) -> tuple[int, int]:
    """Return bytes of flash, and of data that is there from the start."""
    text, data, bss = (int(field) for field in _call(["arm-none-eabi-size", str(elf)], elf.parent).split()[6:9])
    return text + data, data + bss


def _names(elf: Path) -> set[str]:
    return {line.split()[-1] for line in _call(["arm-none-eabi-nm", str(elf)], elf.parent).splitlines() if line}


def _call(command: Sequence[str], folder: Path) -> str:
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode:
        first = next((line for line in done.stderr.splitlines() if "error" in line), done.stderr[-300:])
        raise PeerError(f"{Path(command[0]).name} refuses it: {first}")
    return done.stdout


class PeerError(Exception):
    """Why a peer has no figures."""

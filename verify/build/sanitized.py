"""Run a controller's C on this machine under the undefined-behavior and address sanitizers, over the same stimuli."""

from __future__ import annotations

import os
import re
import struct
import subprocess
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from firmloop.codegen.bundle import Bundle
from firmloop.codegen.host import host_files
from firmloop.identify.simulation.compiler import ToolError, built
from firmloop.identify.simulation.scratch import scratch_folder
from firmloop.quantize.program import Program
from firmloop.verify.block import Block, total_steps
from firmloop.verify.build.host import WARNINGS
from firmloop.verify.compare import First, differing, record_type
from firmloop.verify.packing import records
from firmloop.verify.reference import Trace
from firmloop.verify.verdict import Undefined

# float-cast-overflow is no part of "undefined": a float that no integer holds becomes another one on each core.
SANITIZED_FLAGS = (
    *(*WARNINGS, "-ffp-contract=off", "-fsanitize=undefined,float-cast-overflow,address"),
    *("-fno-sanitize-recover=all", "-O1", "-g", "-fno-omit-frame-pointer"),
)
# What the caller's environment asks of a sanitizer must not turn a find into status 0, nor look for leaks under ptrace.
OPTIONS = {
    "UBSAN_OPTIONS": "print_stacktrace=1:halt_on_error=1:exitcode=1",
    "ASAN_OPTIONS": "detect_leaks=0:halt_on_error=1:exitcode=1",
    "LC_ALL": "C",
}
LONGEST_RUN = 300.0  # s, of all steps together
COUNTER_BYTES = 8  # before the records, of how many are done
STEPS_SOLVING = 10_000  # of a program that solves: a nonlinear one takes a millisecond each

_FOUND = re.compile(r"(?:(?P<place>\S+?:\d+)(?::\d+)?: runtime error|ERROR: AddressSanitizer): (?P<what>.*)")
_ADDRESS = re.compile(r" on (?:unknown )?address 0x.*| \(pc .*| 0x[0-9a-f]+")  # another one in every run
_FRAME = re.compile(r"^\s*#\d+ .*? in \w+ (\S+?):(\d+)", re.MULTILINE)
_OWN_FAILURE = re.compile(r"failed to|out of memory|allocation-size|Shadow memory|does not come first", re.IGNORECASE)
_NO_SANITIZERS = re.compile(r"(?:-l|lib)(?:asan|ubsan)|-fsanitize")


@dataclass(frozen=True, slots=True)
class Sanitized:
    """How many steps ran, in how many values they were not the reference's, and what a sanitizer stopped."""

    steps: int
    differences: int
    first: First | None
    undefined: Undefined | None
    not_run: str  # why no step, or not every one of them, ran; empty where nothing is missing


@dataclass(frozen=True, slots=True)
class SanitizedRun:
    """What the program under the sanitizers left: of the lanes in `parts` the records that are done, and its end."""

    parts: Sequence[Block]
    records: Any
    status: int | None  # None where it did not end in time
    said: str
    not_built: str = ""  # why it could not be


def run_sanitized(program: Program, bundle: Bundle, blocks: Sequence[Block]) -> SanitizedRun:
    """Run the lanes of every block as one program under the sanitizers.

    Of a program that solves, only the first lanes of each block run, about `STEPS_SOLVING` steps in all.

    Raises
    ------
    ToolError
        when there is no compiler, or it refuses the code.
    """
    parts = _lanes(program, blocks)
    given = b"".join(
        struct.pack("<II", *part.inputs.shape[:2]) + records(program, part.inputs, part.settings) for part in parts
    )
    with scratch_folder(Path(tempfile.gettempdir()), "firmloop") as folder:
        try:
            program_file = built(host_files(bundle), (*bundle.sources, "host.c", "host_main.c"), SANITIZED_FLAGS)
        except ToolError as error:
            if _NO_SANITIZERS.search(str(error)):
                missing = f"this gcc has no sanitizers; install libasan and libubsan: {error}"
                return SanitizedRun((), np.zeros(0, record_type(program)), 0, "", missing)
            raise
        kind = record_type(program)
        status, said = _run(program_file, folder, given, total_steps(parts) * kind.itemsize)
        written = (folder / "records").read_bytes()
    done = np.frombuffer(written, np.uint64, 1)[0]
    return SanitizedRun(parts, np.frombuffer(written, kind, int(done), COUNTER_BYTES), status, said)


def compare_sanitized(program: Program, bundle: Bundle, run: SanitizedRun, traces: Sequence[Trace]) -> Sanitized:
    """Compare each bit of what ran under the sanitizers with the reference, and say what they found."""
    got = run.records
    differences, first = _compared(program, run.parts, traces, got)
    found, missing = None, run.not_built
    if run.status is None:
        missing = f"the program under the sanitizers did not end within {LONGEST_RUN:.0f} s; {len(got):,} steps ran"
    elif run.status != 0:
        found = _found(run.said, bundle, program, run.parts, traces, len(got))
        lines = (line.strip() for line in run.said.splitlines() if line.strip())
        words = next(lines, f"it ended with status {run.status}")
        missing = "" if found else f"the program under the sanitizers could not run: {words}"
    return Sanitized(len(got), differences, first, found, missing)


def _lanes(program: Program, blocks: Sequence[Block]) -> list[Block]:
    """Return of every block the lanes that run."""
    if not program.solves:
        return list(blocks)
    share = min(1.0, STEPS_SOLVING / max(1, total_steps(blocks)))
    counts = [max(1, round(share * len(b.inputs))) for b in blocks]
    return [
        Block(b.name, b.inputs[:n], None if b.settings is None else b.settings[:n])
        for b, n in zip(blocks, counts, strict=True)
    ]


def _run(program_file: Path, folder: Path, given: bytes, answered: int) -> tuple[int | None, str]:
    """Return the status, None where the program did not end in time, and what it said.

    It leaves the number of records that are done and `answered` bytes of records.
    """
    (folder / "given").write_bytes(given)
    with (folder / "given").open("rb") as source, (folder / "records").open("w+b") as sink:
        sink.truncate(COUNTER_BYTES + answered)
        try:
            done = subprocess.run(
                [str(program_file)],
                stdin=source,
                stdout=sink,
                stderr=subprocess.PIPE,
                env={**os.environ, **OPTIONS},
                timeout=LONGEST_RUN,
                check=False,
            )
        except subprocess.TimeoutExpired:
            return None, ""
        except OSError as error:
            return 1, f"{error.strerror}"
    return done.returncode, done.stderr.decode(errors="replace")


def _compared(program: Program, parts: Sequence[Block], traces: Sequence[Trace], got: Any) -> tuple[int, First | None]:
    """Compare the records, as far as there are any, with the reference."""
    count, begins = 0, 0
    first: First | None = None
    for number, (part, trace) in enumerate(zip(parts, traces, strict=False)):  # none where it was not built
        lanes, steps, _ = part.inputs.shape
        own = got[begins : begins + lanes * steps]
        whole, rest = divmod(len(own), steps)
        pieces = [(0, own[: whole * steps].reshape(whole, steps)), (whole, own[None, len(own) - rest :])]
        for lane, piece in pieces:
            if piece.size:
                wrong, found = differing(program, trace, lane, piece)
                count += wrong
                first = first or (found and replace(found, block=number))
        begins += lanes * steps
    return count, first


def _found(
    said: str, bundle: Bundle, program: Program, parts: Sequence[Block], traces: Sequence[Trace], done: int
) -> Undefined | None:
    """Return what a sanitizer says it found after `done` steps; None where it says that it could not run itself."""
    found = _FOUND.search(said)
    if found is None or _OWN_FAILURE.search(found["what"]):
        return None
    # The caller in the controller's own source says more than the operation it calls, whose line the words may name.
    frames = [(Path(file).name, int(line)) for file, line in _FRAME.findall(said)]
    if found["place"]:
        file, _, line = found["place"].rpartition(":")
        frames.append((Path(file).name, int(line)))
    own = [frame for frame in frames if frame[0] in bundle.files]
    file, number = next((frame for frame in own if frame[0] == bundle.sources[0]), own[0] if own else ("", 0))
    lines = bundle.files[file].splitlines() if file else []
    operation = lines[number - 1].strip() if 0 < number <= len(lines) else ""
    at = _place(program, parts, traces, done)
    return Undefined(_ADDRESS.sub("", found["what"]).strip(), file, number, operation, at)


def _place(program: Program, parts: Sequence[Block], traces: Sequence[Trace], done: int) -> First:
    """Return where the step stands that did not end, with the answer that the reference gives."""
    left, output = done, program.outputs[0].name
    for number, (part, trace) in enumerate(zip(parts, traces, strict=True)):
        lanes, steps, _ = part.inputs.shape
        if left < lanes * steps:
            lane, step = divmod(left, steps)
            return First(number, lane, step, output, float(trace.outputs[lane, step, 0]), float("nan"))
        left -= lanes * steps
    raise AssertionError("a step of no block")

"""Write the first text of a project, with a comment at each line that was guessed."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from shlex import quote

from firmloop.identify.recordings.columns import Column, RowClock, rename_line
from firmloop.identify.signal import Signal
from firmloop.project.schema import schema_file


@dataclass(frozen=True, slots=True)
class FirstParameter:
    """One entry of [plant.parameters]: its start, whether it is fitted, and what a reader has to know."""

    name: str
    value: float
    free: bool
    says: str = ""


@dataclass(frozen=True, slots=True)
class FirstProject:
    """What was guessed; `says` holds a remark by the foreign column's name, `asides` what was not used.

    `closed_loop` is the time constant that is asked for, s, None before the plant is known; `integral` is ki of a
    controller for a plant that no rule tunes; `loop` holds reference, measurement and output.
    """

    name: str
    train: tuple[Path, ...]
    test: tuple[Path, ...]
    rename: Mapping[str, Column]
    says: Mapping[str, str]
    clock: RowClock | None
    kind: str
    input: str
    outputs: tuple[str, ...]
    parameters: tuple[FirstParameter, ...]
    period: float  # s
    closed_loop: float | None
    loop: tuple[Signal, ...]
    asides: tuple[str, ...] = ()
    integral: float | None = None


def first_text(first: FirstProject, folder: Path) -> str:
    """Return the project as it may stand in `folder`."""
    return "\n".join(
        [
            f"#:schema {schema_file().as_uri()}",
            f"# Guessed by: firmloop init {' '.join(quote(_shown(path.name)) for path in (*first.train, *first.test))}",
            "# Check the lines with a comment. What a key means: firmloop explain KEY",
            "schema = 1",
            f"name = {json.dumps(first.name)}  # of the C functions: {first.name}_init, {first.name}_step",
            "",
            *_recordings(first, folder),
            "",
            *_plant(first),
            "",
            *_controller(first),
            "",
            "[signals]  # the ranges that the C is proven for, in the plant's units",
            *(_signal(signal) for signal in first.loop),
            "",
            "[arithmetic]",
            'number = "float32"  # or "float64"; "fixed" with bits = 16 or 32 for a chip without floating point',
            "",
            "[target]",
            'names = ["host"]  # this machine; firmloop targets lists boards and emulated cores',
            "",
        ]
    )


def _recordings(first: FirstProject, folder: Path) -> Iterator[str]:
    yield "[recordings]"
    yield f"train = {_paths(first.train, folder)}  # fitted"
    if first.test:
        yield f"test = {_paths(first.test, folder)}  # only scored"
    else:
        yield '# test = ["another.csv"]  # a recording that is only scored; without one nothing shows an overfit'
    if first.clock is not None:
        yield f"period_s = {first.clock.period!r}  # between two rows, in place of the file's own stamps"
        yield f"start_s = {first.clock.start!r}"
    for aside in first.asides:
        yield f"# {_shown(aside)}"
    if first.rename:
        yield "[recordings.rename]  # the file's column = the name firmloop knows"
    for foreign, column in first.rename.items():
        yield _line(foreign, column) + (f"  # {first.says[foreign]}" if foreign in first.says else "")


def _plant(first: FirstProject) -> Iterator[str]:
    yield "[plant]"
    yield f"kind = {json.dumps(first.kind)}  # guessed by the columns; firmloop explain {first.kind}"
    yield f"input = {json.dumps(first.input)}"
    outputs = ", ".join(map(json.dumps, first.outputs))
    yield f"outputs = [{outputs}]" + ("  # the first is controlled" if len(first.outputs) > 1 else "")
    yield "[plant.parameters]  # where the fit begins: read off the recordings; a data sheet is better"
    for each in first.parameters:
        entry = f"{each.name} = {{ value = {each.value:.4g}, free = {str(each.free).lower()} }}"
        yield entry + (f"  # {each.says}" if each.says else "")


def _controller(first: FirstProject) -> Iterator[str]:
    yield "[controller]"
    yield 'kind = "pid"'
    yield f"period_s = {first.period:g}  # between two steps of the C"
    if first.integral is not None:
        yield "kp = 0.0  # the plant rings, which no rule tunes: an integral alone, slow enough to leave it in peace"
        yield f"ki = {first.integral:.4g}  # a quarter of what makes the loop ring for ever"
        return
    yield 'tune = "simc"  # or give kp, ki, kd; firmloop tune compares rules'
    if first.closed_loop is not None:
        yield f"tau_c_s = {first.closed_loop:.3g}  # time constant of the closed loop: smaller is quicker"


def _signal(signal: Signal) -> str:
    unit = json.dumps(signal.unit or "1", ensure_ascii=False)
    return f"{signal.name} = {{ unit = {unit}, low = {signal.low:g}, high = {signal.high:g} }}"


def _line(foreign: str, column: Column) -> str:
    line = rename_line(foreign, column.name, column.unit)
    if column.is_a_name:
        return f"{line.partition(' = {')[0]} = {json.dumps(column.name)}"
    line = line if column.unit else line.replace(', unit = ""', "")
    more = [
        f"{key} = {value!r}"
        for key, value, usual in (
            ("scale", column.scale, 1.0),
            ("offset", column.offset, 0.0),
            ("wraps", column.wraps, 0.0),
        )
        if value != usual
    ]
    return ", ".join([line.removesuffix(" }"), *more]) + " }"


def _shown(text: str) -> str:
    """Return what a comment may hold: a name from a file must not end its line."""
    return text if text.isprintable() else json.dumps(text)


def _paths(paths: Sequence[Path], folder: Path) -> str:
    return json.dumps([Path(os.path.relpath(path, folder)).as_posix() for path in paths], ensure_ascii=False)

"""Guess a whole project from recordings: each plant that may fit is fitted, and the simplest good one is taken."""

from __future__ import annotations

import math
import re
import tempfile
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import groupby
from pathlib import Path

import numpy as np

from firmloop.codegen.bundle import CodegenError
from firmloop.codegen.names import LONGEST, check_identifier
from firmloop.identify.error import IdentifyError
from firmloop.identify.fitting.fit import Fit
from firmloop.identify.recordings.recording import Recording
from firmloop.identify.signal import Signal
from firmloop.identify.simulation.linearize import linearize
from firmloop.identify.simulation.scratch import scratch_folder
from firmloop.identify.units import carried_unit, unit_of
from firmloop.project.first_text import FirstParameter, FirstProject, first_text
from firmloop.project.project import Project, read_project
from firmloop.project.table import ProjectError
from firmloop.stages import fitting, making
from firmloop.stages.data import Data
from firmloop.stages.progress import Report
from firmloop.stages.reachable import held_levels
from firmloop.stages.starting.candidates import Proposal, proposals
from firmloop.stages.starting.first_gains import integral_of_a_ringing_plant
from firmloop.stages.starting.reading import POSITION, Guesses, integrates, read_guessed

_NEAR = 3.0  # % of fit that a kind which tells more, or has less to fit, may be behind the best one
_GOOD = 98.0  # % of fit from which no further kind is tried
_ROWS = 8000  # of each recording that the kinds are compared on; `firmloop identify` takes them all
_WIDER = 0.2  # of the recorded span, on either side of what the controller may see
_STEPS_PER_LAG = 50.0  # of the controller, at most, where the recording is quicker
_HERTZ = ("1/s", "s^-1", "s-1", "/s")
_TURNS = 'taken as rad/s; of turns a second give unit = "rev/s"'
_COUNTS = ", for it integrates as a position does; of counts give the scale 6.283185307 / counts a turn"
_LAST = 1e-9  # of a value: what its last digit is printed to
_QUICKER = 3.0  # times the plant's own lag, that the closed loop is asked for


def guess_project(
    paths: Sequence[Path], name: str, period: float | None, left_out: Sequence[str], report: Report
) -> FirstProject:
    """Return the project of recordings: the last of several is only scored.

    Raises
    ------
    IdentifyError, ProjectError
        when the columns cannot be told apart, or no plant kind fits.
    """
    found = read_guessed(paths, period, left_out)
    whole = tuple(path.absolute() for path in paths)
    train, test = (whole[:-1], whole[-1:]) if len(whole) > 1 else (whole, ())
    drive, outputs = found.input.name, tuple(each.name for each in found.outputs)
    step = float(np.median(np.diff(found.recordings[0].time)))
    base = FirstProject(
        name=_c_name(name),
        train=train,
        test=test,
        rename=found.rename,
        says=_remarks(found),
        clock=found.clock,
        kind="",
        input=drive,
        outputs=outputs,
        parameters=(),
        period=_round_down(step),
        closed_loop=None,
        loop=_loop(found.recordings, drive, outputs[0]),
        asides=found.asides,
    )
    seen = Data(tuple(each.part(0, _ROWS) for each in found.recordings[: len(train)]), ())
    tried: list[_Tried] = []
    complaint: Exception | None = None
    kinds = [list(same) for _, same in groupby(proposals(found.recordings[0], drive, outputs), lambda each: each[0])]
    for k, kind in enumerate(kinds):
        report(k / len(kinds), f"trying {kind[0][0]}")
        ways: list[_Tried] = []
        for proposal in kind:
            try:
                ways.append(_tried(base, proposal, seen))
            except (IdentifyError, ProjectError, CodegenError) as error:
                complaint = complaint or error
        tried += [_plainest(ways)] if ways else []
        if ways and tried[-1].score > _GOOD:
            break
    if sums := _integral(seen, drive, outputs[0]):  # which a slow swing makes up for
        tried = [each for each in tried if each.project.integral is None]
    if not tried and isinstance(complaint, ProjectError) and not sums:
        raise IdentifyError(f"{paths[0]}: no project can be made of it: {complaint}")
    if not tried:
        raise IdentifyError(f"no plant kind fits {drive} -> {outputs[0]}: {sums or complaint}")
    best = max(each.score for each in tried)
    return next(each.project for each in tried if each.score >= best - _NEAR)


@dataclass(frozen=True, slots=True)
class _Tried:
    """A project with the fit of its first output, by which kinds are compared, and of the worst one, %."""

    score: float
    least: float
    project: FirstProject


def _plainest(ways: Sequence[_Tried]) -> _Tried:
    """Return the way with the least to fit of those that come near the best, and of as many the best."""
    near = [way for way in ways if way.least >= max(each.least for each in ways) - _NEAR]
    return min(near, key=lambda way: (sum(each.free for each in way.project.parameters), -way.least))


def _tried(base: FirstProject, proposal: Proposal, seen: Data) -> _Tried:
    """Fit one kind and tune a controller for it."""
    kind, outputs, parameters = proposal
    first = replace(base, kind=kind, outputs=outputs, parameters=parameters)
    with scratch_folder(Path(tempfile.gettempdir()), ".firmloop_init") as folder:
        project = _read(first, folder)
        found = fitting.fit_alone(project, seen)
        first = _settled(first, found, max(float(each.time[-1] - each.time[0]) for each in seen.train))
        making.design(_read(first, folder), found.plant)
    scores = [float(np.mean([each.scores[name].fit_percent for each in found.train])) for name in outputs]
    sure = [score if math.isfinite(score) else -math.inf for score in scores]
    return _Tried(sure[0], min(sure), first)


def _read(first: FirstProject, folder: Path) -> Project:
    """Read the project as it would be written; a complaint names no file, as there will be none."""
    file = folder / "project.toml"
    file.write_text(first_text(first, folder), encoding="utf-8")
    try:
        return read_project(file)
    except ProjectError as error:
        raise ProjectError(re.sub(rf"^{re.escape(str(file))}:(\d+:)? ", "", str(error))) from None


def _settled(first: FirstProject, found: Fit, longest: float) -> FirstProject:
    """Put fitted values in place of starts, and ask for a closed loop that the plant's own lag allows.

    No lag is told to be longer than the longest recording, s: of what only sums up, a fit says that it takes years.
    """
    given = {each.name: each for each in first.parameters}
    fitted = {each.name: each for each in found.plant.parameters}
    told = [
        FirstParameter(
            name,
            one.value,
            given[name].free if name in given else True,
            given[name].says if name in given else "",
        )
        for name, one in fitted.items()
    ]
    linear = linearize(found.plant)
    poles = np.linalg.eigvals(linear.a) if len(linear.a) else np.array([])
    lags = [1.0 / -pole.real for pole in poles if pole.real < -1e-9 * float(np.abs(poles).max())]
    slowest = min(max(lags, default=20.0 * first.period), longest)
    period = max(first.period, _round_down(slowest / _STEPS_PER_LAG))
    closed = max(slowest / _QUICKER, 5.0 * period, linear.delay)
    loop = (_within_reach(first.loop, held_levels(first.loop[2:], found.plant, linear)), *first.loop[1:])
    integral = integral_of_a_ringing_plant(linear, period)
    asked = float(f"{closed:.2g}")
    return replace(first, parameters=tuple(told), period=period, closed_loop=asked, loop=loop, integral=integral)


def _within_reach(loop: Sequence[Signal], held: tuple[float, float] | None) -> Signal:
    """Return the reference without what no output of the loop holds the plant at, where any of it is left."""
    reference = loop[0]
    if held is None:
        return reference
    digit = 10.0 ** (math.floor(math.log10(max(held[1] - held[0], 1e-300))) - 2)  # three digits of what can be held
    low = max(reference.low, float(f"{math.ceil(held[0] / digit) * digit:.6g}"))
    high = min(reference.high, float(f"{math.floor(held[1] / digit) * digit:.6g}"))
    return replace(reference, low=low, high=high) if low < high else reference


def _loop(recordings: Sequence[Recording], drive: str, output: str) -> tuple[Signal, ...]:
    seen, sent = (_span(recordings, name) for name in (output, drive))
    wider = _WIDER * (seen[1] - seen[0])
    low, high = (float(f"{end:.2g}") for end in (seen[0] - wider, seen[1] + wider))
    if seen[0] < 0.0 < seen[1] and -0.5 < (seen[0] + seen[1]) / (seen[1] - seen[0]) < 0.5:
        high = max(-low, high)
        low = -high
    return (
        Signal("reference", carried_unit(output), low, high),
        Signal("measurement", carried_unit(output), low, high),
        Signal("output", carried_unit(drive), min(_outwards(sent[0], -1), 0.0), max(_outwards(sent[1], 1), 0.0)),
    )


def _outwards(value: float, way: int) -> float:
    """Return a value with three digits, rounded up or down: what was recorded stays within."""
    near = float(f"{value:.3g}")
    if value == 0.0 or way * (near - value) >= -_LAST * abs(value):
        return near
    return float(f"{near + way * 10.0 ** (math.floor(math.log10(abs(value))) - 2):.3g}")


def _span(recordings: Sequence[Recording], name: str) -> tuple[float, float]:
    columns = [each.columns[name] for each in recordings if name in each.columns]
    if len(columns) < len(recordings):
        lacking = next(each.source for each in recordings if name not in each.columns)
        first = recordings[0].source
        raise IdentifyError(
            f"{lacking}: no column seems to be {name}, as in {first}, by whose names all files are read: give the "
            "columns of both the same names, or make a project of each"
        )
    return min(float(each.min()) for each in columns), max(float(each.max()) for each in columns)


def _integral(seen: Data, drive: str, output: str) -> str:
    """Say what can be done about an output that integrates and is no position, of which no lag has a gain."""
    first = seen.train[0]
    if output.startswith("position_") or not integrates(first.columns[drive], first.columns[output]):
        return ""
    return (
        f"{output} goes on rising or falling where {drive} stays, as an integral does, and of the plant kinds only "
        "rotary_stage and linear_stage integrate; call the column position_rad or position_m in the file's header, "
        "and its unit counts as rad or m"
    )


def _remarks(found: Guesses) -> dict[str, str]:
    used = [(each, bool(each.unit)) for each in (found.input, *found.outputs)]
    used += [(found.time, found.time.known)] if found.time else []
    why = {each.foreign: _COUNTS for each in found.outputs if each.name == POSITION and not each.quantity}
    turns = {each.foreign: _TURNS for each, _ in used if each.unit in _HERTZ and unit_of(each.name) == "rad/s"}
    return turns | {
        each.foreign: f"no unit in the file: taken as {each.unit or unit_of(each.name)}{why.get(each.foreign, '')}"
        for each, told in used
        if unit_of(each.name) and not told and each.foreign in found.rename
    }


def _round_down(seconds: float) -> float:
    """Return a period of 1, 2 or 5 with a power of ten, at most a hair longer."""
    power = 10.0 ** math.floor(math.log10(seconds * 1.001))
    return float(f"{max(k for k in (1, 2, 5) if k * power <= seconds * 1.001) * power:.3g}")


def _c_name(name: str) -> str:
    """Return the nearest name that the C functions may have."""
    words = re.findall(r"[a-z0-9]+", name.lower())
    plain = "_".join(words)[:LONGEST].strip("_")
    plain = plain if plain and plain[0].isalpha() else f"plant_{plain}"[:LONGEST].strip("_")
    for own in (plain, f"{plain[:24]}_loop"):
        with suppress(CodegenError):
            return check_identifier(own, "project name")
    return f"loop_{plain[:24]}".strip("_")  # of a name whose beginning is taken, such as fl_

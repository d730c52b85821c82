"""Inputs that make a controller show its differences: corners, noise, tracking, worst cases, recorded signals.

Everything is drawn from one seed. A lane is one controller started afresh. Wide noise keeps most controllers at their
limits, where a wrong gain cannot be seen; so a part of the lanes moves all inputs together and apart by amounts drawn
evenly over the decades, down to one unit in the last place. What a linear law can be driven to is reached by one input
only, the reversed sign of its impulse response (see `design/linear/reach.py`); that input is among them for every
output and state, beside full-scale squares and chirps.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from firmloop.quantize.program import Program, Value
from firmloop.verify.reference import Raw, Trace, element_type, run
from firmloop.verify.stimuli.approach import approaches
from firmloop.verify.stimuli.edges import edges
from firmloop.verify.stimuli.settings import requests

Array = NDArray[np.float64]
LANE_STEPS = 1000
FRESH_STEPS = 8
LONGEST_WORST = 40_000  # steps of a worst case
LONGEST_PLANNED = 100  # samples of the response of a program that follows a plant's equations: each takes long
EDGE_STEPS = 3
SEARCHED = 16  # lanes of each character in which limits are sought that are crossed late,
LATEST = 400  # and how late
RECORDED_STEPS = 2500  # of a lane cut from a recording: many lanes run at once, one long one does not


@dataclass(frozen=True, slots=True)
class Block:
    """Raw inputs (lanes, steps, m) of one character; `settings` (lanes, steps, k) asks for values of the parameters."""

    name: str
    inputs: Raw
    settings: Raw | None = None  # None where nothing can be tuned, or nothing is


def stimuli(program: Program, recorded: Sequence[Mapping[str, Array]], steps: int, seed: int) -> list[Block]:
    """Return blocks that hold `steps` steps, and what fits of the recorded signals on top.

    Parameters
    ----------
    recorded
        physical signals by input name, one sample a controller period; an input that is missing follows a step.
    """
    random = np.random.default_rng(seed)
    length = min(LANE_STEPS, max(1, steps))
    blocks: list[Block] = []
    for name, make, share, span in MAKERS:
        if sum(len(block.inputs) * block.inputs.shape[1] for block in blocks) >= steps:
            break
        span = min(span, length)
        count = max(1, round(share * steps / span))
        blocks.append(Block(name, make(program, random, count, span)))
    blocks = _cut(blocks, max(1, steps))
    blocks += _rest(program, random, max(1, steps) - sum(b.inputs.shape[0] * b.inputs.shape[1] for b in blocks))
    for signals in recorded:
        blocks += _lanes(_recorded(program, signals, random))
    if program.tunable:
        return [Block(b.name, b.inputs, requests(program, random, *b.inputs.shape[:2])) for b in blocks]
    return blocks


def characters(program: Program, lanes: int, steps: int, seed: int) -> list[Block]:
    """Return lanes of `steps` steps, so many of each character whose lanes are not shorter by nature."""
    random = np.random.default_rng(seed)
    makers = [row for row in MAKERS if row[3] == LANE_STEPS and row[1] is not _afar]
    return [Block(name, make(program, random, lanes, steps)) for name, make, _, _ in makers]


def singles(program: Program, steps: int, seed: int) -> list[Block]:
    """Return `steps` lanes of one step each, in equal shares of what needs no more."""
    random = np.random.default_rng(seed)
    share = max(1, steps // len(SINGLES))
    return [Block(name, make(program, random, share, 1)) for name, make, _, _ in SINGLES]


def adversarial(program: Program, steps: int, seed: int) -> list[Block]:
    """Return about `steps` steps of what brings values and roundings to their ends, in equal shares.

    The worst cases are as long as the steps allow: a slow state needs many samples to reach its end.
    """
    random = np.random.default_rng(seed)
    share = steps // len(ADVERSARIAL)
    ends = 2 * (len(program.outputs) + len(program.state))
    blocks = []
    for name, make, _, span in ADVERSARIAL:
        length = max(span, min(LONGEST_WORST, share // ends)) if make is _worst else span
        blocks.append(Block(name, make(program, random, max(1, round(share / length)), length)))
    if program.tunable:
        return [Block(b.name, b.inputs, requests(program, random, *b.inputs.shape[:2])) for b in blocks]
    return blocks


def run_blocks(
    program: Program, blocks: Sequence[Block], progress: Callable[[float, str], None] = lambda share, doing: None
) -> list[Trace]:
    """Run `program` on every block; the blocks of one length side by side, which takes hardly longer than one."""
    traces: dict[int, Trace] = {}
    groups = by_length(blocks)
    for k, group in enumerate(groups):
        progress(k / len(groups), "reference: " + ", ".join(dict.fromkeys(blocks[i].name for i in group)))
        whole = side_by_side([blocks[i] for i in group])
        trace = run(program, whole.inputs, whole.settings)
        at = 0
        for i in group:
            end = at + len(blocks[i].inputs)
            traces[i] = Trace(trace.outputs[at:end], trace.status[at:end], trace.state[at:end])
            at = end
    return [traces[i] for i in range(len(blocks))]


def by_length(blocks: Sequence[Block]) -> list[list[int]]:
    """Return the places of the blocks of one length, together."""
    groups: dict[int, list[int]] = {}
    for i, block in enumerate(blocks):
        groups.setdefault(block.inputs.shape[1], []).append(i)
    return list(groups.values())


def side_by_side(blocks: Sequence[Block]) -> Block:
    """Return one block with the lanes of all these, which have one length."""
    if len(blocks) == 1:
        return blocks[0]
    asked = [block.settings for block in blocks if block.settings is not None]
    assert len(asked) in (0, len(blocks)), "all blocks set parameters, or none does"
    inputs = np.concatenate([block.inputs for block in blocks])
    return Block(blocks[0].name, inputs, np.concatenate(asked) if asked else None)


def _lanes(inputs: Raw) -> list[Block]:
    """Cut one long recorded lane (1, steps, m) into lanes of at most RECORDED_STEPS and a rest."""
    _, steps, width = inputs.shape
    whole = steps // RECORDED_STEPS
    cut = inputs[:, : whole * RECORDED_STEPS].reshape(whole, RECORDED_STEPS, width)
    rest = inputs[:, whole * RECORDED_STEPS :]
    return [Block("recorded", part) for part in (cut, rest) if part.size]


def _cut(blocks: list[Block], steps: int) -> list[Block]:
    """Keep at most `steps` steps in all; the last lane kept may be a short one."""
    kept, left = [], steps
    for block in blocks:
        lanes, length, _ = block.inputs.shape
        whole = min(lanes, left // length)
        if whole:
            kept.append(Block(block.name, block.inputs[:whole]))
            left -= whole * length
        if whole < lanes and 0 < left < length:
            kept.append(Block(block.name, block.inputs[whole : whole + 1, :left]))
            left = 0
    return kept


def _rest(program: Program, random: np.random.Generator, steps: int) -> list[Block]:
    """Return tracking lanes of `steps` steps in all: what shares that are rounded, or not wanted whole, leave.

    They are as long as other lanes, which they then run beside (see `run_blocks`).
    """
    blocks = []
    for length in (LANE_STEPS, FRESH_STEPS, 1):
        lanes, steps = divmod(steps, length)
        if lanes:
            blocks.append(Block("tracking", _tracking(program, random, lanes, length)))
    return blocks


def to_raw(value: Value, physical: Array) -> Raw:
    """Round physical samples into the type of one input, saturating at what the type holds."""
    kind = element_type(value.number)
    if value.number.kind == "float":
        with np.errstate(over="ignore"):
            return physical.astype(kind)
    limits = np.iinfo(kind)
    return np.clip(np.floor(physical * 2.0**value.number.fraction + 0.5), limits.min, limits.max).astype(kind)


def to_physical(value: Value, raw: Raw) -> Array:
    """Return raw samples in the input's or output's unit."""
    if value.number.kind == "float":
        return raw.astype(np.float64)
    return raw.astype(np.float64) * 2.0**-value.number.fraction


def _stack(program: Program, columns: Sequence[Array]) -> Raw:
    return np.stack([to_raw(v, c) for v, c in zip(program.inputs, columns, strict=True)], axis=-1)


def _range(value: Value) -> tuple[float, float]:
    scale = 2.0**-value.number.fraction
    return value.low * scale, value.high * scale


def _resolution(value: Value) -> float:
    low, high = _range(value)
    return 2.0**-value.number.fraction if value.number.kind == "fixed" else max(abs(low), abs(high)) * 2.0**-22


def _noise(program: Program, random: np.random.Generator, lanes: int, length: int) -> Raw:
    return _stack(program, [random.uniform(*_range(v), size=(lanes, length)) for v in program.inputs])


def _tracking(program: Program, random: np.random.Generator, lanes: int, length: int) -> Raw:
    """All inputs follow one slow walk across their ranges; each departs from it by a lane's own amplitude."""
    walk = np.cumsum(random.normal(size=(lanes, length)), axis=1)
    walk *= 10.0 ** random.uniform(-3.5, -1.0, size=(lanes, 1))
    place = 0.5 + 0.5 * np.sin(walk + random.uniform(0, 2 * np.pi, size=(lanes, 1)))
    columns = []
    for value in program.inputs:
        low, high = _range(value)
        smallest = np.log10(_resolution(value) / (high - low))
        size = (high - low) * 10.0 ** random.uniform(smallest, 0.0, size=(lanes, 1))
        noise = random.normal(size=(lanes, length))
        drift = np.cumsum(noise, axis=1) / np.sqrt(length)
        away = np.where(random.random((lanes, 1)) < 0.5, noise, drift) * size * 0.3
        columns.append(np.clip(low + (high - low) * place + away, low, high))
    return _stack(program, columns)


def _saturation(program: Program, random: np.random.Generator, lanes: int, length: int) -> Raw:
    """One corner held for most of a lane, then the opposite one, then small noise about the middle."""
    columns = []
    first = int(length * 0.6)
    second = int(length * 0.25)
    for value in program.inputs:
        low, high = _range(value)
        up = random.random((lanes, 1)) < 0.5
        held = np.broadcast_to(np.where(up, high, low), (lanes, first))
        back = np.broadcast_to(np.where(up, low, high), (lanes, second))
        rest = (low + high) / 2 + (high - low) * 0.001 * random.normal(size=(lanes, length - first - second))
        columns.append(np.concatenate([held, back, np.clip(rest, low, high)], axis=1))
    return _stack(program, columns)


def _worst(program: Program, random: np.random.Generator, lanes: int, length: int) -> Raw:
    """Drive each output and state in turn to the L1 bound of its response, up and down, at the lane's end.

    Half of the lanes stay off the ends of the ranges by up to a thousandth, so that no two samples round alike.
    """
    answered = min(length, LONGEST_PLANNED) if program.routines else length
    signs = np.sign(_impulse_responses(program, answered))[:, ::-1]
    signs = np.pad(signs, ((0, 0), (length - answered, 0), (0, 0)))
    signs = np.where(signs == 0, 1.0, signs)  # (targets, length, m)
    targets = np.arange(lanes) // 2 % len(signs)
    drive = signs[targets] * np.where(np.arange(lanes) % 2, -1.0, 1.0)[:, None, None]
    off = np.where(np.arange(lanes) // (2 * len(signs)) % 2, 1e-3, 0.0)[:, None]
    columns = []
    for j, value in enumerate(program.inputs):
        low, high = _range(value)
        away = off * (high - low) * random.random((lanes, length))
        columns.append(np.where(drive[..., j] > 0, high - away, low + away))
    return _stack(program, columns)


def _impulse_responses(program: Program, length: int) -> Array:
    """Return (targets, length, m): how outputs and states answer a short pulse at each input, from its middle."""
    middle = np.array([sum(_range(v)) / 2 for v in program.inputs])
    pulse = np.array([(v_range[1] - v_range[0]) / 8 for v_range in map(_range, program.inputs)])
    drive = np.broadcast_to(middle, (len(middle) + 1, length + 1, len(middle))).copy()
    drive[np.arange(1, len(middle) + 1), 1, np.arange(len(middle))] += pulse  # a first sample may be special
    trace = run(program, _stack(program, list(np.moveaxis(drive, -1, 0))))
    columns = [to_physical(v, trace.outputs[..., j]) for j, v in enumerate(program.outputs)]
    columns += [to_physical(v, trace.state[..., j]) for j, v in enumerate(program.state)]
    answers = np.array([column[1:] - column[0] for column in columns])[:, :, 1:]  # (targets, m, length)
    return np.moveaxis(np.nan_to_num(answers), 1, 2)


def _squares(program: Program, random: np.random.Generator, lanes: int, length: int) -> Raw:
    """Full-scale squares of periods from two samples to the whole lane, inputs together or against each other."""
    longest = max(1.0, np.log2(length))
    half = np.exp2(random.uniform(0.0, longest - 1.0, size=(lanes, 1))).astype(int)
    up = (np.arange(length) // half) % 2 == 0
    columns = []
    for value in program.inputs:
        low, high = _range(value)
        turned = random.random((lanes, 1)) < 0.5
        columns.append(np.where(up ^ turned, high, low))
    return _stack(program, columns)


def _chirps(program: Program, random: np.random.Generator, lanes: int, length: int) -> Raw:
    """Sweeps up to half the sample rate about a random place, of amplitudes over three decades, each in a phase."""
    octaves = np.log2(max(4, length)) - 1
    frequency = np.exp2(octaves * np.arange(length) / length) / max(4, length)  # cycles a sample
    phase = 2 * np.pi * np.cumsum(frequency)
    size = 10.0 ** random.uniform(-3.0, 0.0, size=(lanes, 1))
    place = random.uniform(0.0, 1.0, size=(lanes, 1))
    columns = []
    for value in program.inputs:
        low, high = _range(value)
        wave = np.sin(phase + random.choice([0.0, np.pi / 2, np.pi], size=(lanes, 1)))
        columns.append(np.clip(low + (high - low) * (place + 0.5 * size * wave), low, high))
    return _stack(program, columns)


def _corners(program: Program, random: np.random.Generator, lanes: int, length: int) -> Raw:
    """Hold special values of range and type for one to thirty steps each."""
    columns: list[Any] = []
    for value in program.inputs:
        special = _special(value)
        new = random.random((lanes, length)) < random.uniform(1 / 30, 1.0, size=(lanes, 1))
        new[:, 0] = True
        picks = random.integers(len(special), size=(lanes, length))
        last = np.maximum.accumulate(np.where(new, np.arange(length), 0), axis=1)
        columns.append(special[np.take_along_axis(picks, last, axis=1)])
    return np.stack(columns, axis=-1)


def _special(value: Value) -> Raw:
    kind = element_type(value.number)
    low, high = value.low, value.high
    if value.number.kind == "fixed":
        limits = np.iinfo(kind)
        raw = [0, 1, -1, low, high, low + 1, high - 1, low - 1, high + 1, limits.min, limits.max, (low + high) / 2]
        whole: Raw = np.clip(np.array(raw), limits.min, limits.max).astype(kind)
        return whole
    tiny = float(np.finfo(kind).smallest_subnormal)
    inner = [0.0, -0.0, tiny, -tiny, low, high, (low + high) / 2, low / 3, high / 3]
    outer = [np.inf, -np.inf, np.nan, float(np.finfo(kind).max), low * 2, high * 2, np.finfo(kind).tiny]
    with np.errstate(over="ignore"):
        special = np.array(inner * 2 + outer, dtype=np.float64)
        return special.astype(kind)


def _recorded(program: Program, signals: Mapping[str, Array], random: np.random.Generator) -> Raw:
    length = min((len(s) for s in signals.values()), default=0)
    columns = []
    for value in program.inputs:
        low, high = _range(value)
        if value.name in signals:
            columns.append(np.clip(np.asarray(signals[value.name], dtype=np.float64)[None, :length], low, high))
            continue
        others = [np.asarray(s, dtype=np.float64)[:length] for s in signals.values()]
        middle = float(np.mean(others[0])) if others and length else 0.0
        spread = float(np.std(others[0])) if others and length else 0.0
        held = np.repeat(random.choice([-1.0, 0.0, 1.0], size=length // 200 + 1), 200)[:length]
        columns.append(np.clip(middle + spread * held, low, high)[None, :])
    return _stack(program, columns)


def _edges(program: Program, random: np.random.Generator, lanes: int, length: int) -> Raw:
    return edges(program, random, lanes, length, to_raw)


def _afar(program: Program, random: np.random.Generator, lanes: int, length: int) -> Raw:
    """Bring values to limits that they reach after many samples; noise where none does.

    A program that solves takes long to try, and is left out.
    """
    if not program.tables and program.state:
        samples = lanes * length
        latest = min(length, LATEST, max(1, samples // 3))
        hard = [make(program, random, SEARCHED, latest) for make in (_worst, _squares)]
        drives = np.concatenate([_physical(program, drive) for drive in hard])
        found = approaches(program, random, drives, samples, to_raw)
        if found is not None:
            return found
    return _noise(program, random, lanes, length)


def _physical(program: Program, inputs: Raw) -> Array:
    return np.stack([to_physical(v, inputs[..., j]) for j, v in enumerate(program.inputs)], axis=-1)


# name, maker, share of the steps, steps of a lane
MAKERS = (
    ("tracking", _tracking, 0.37, LANE_STEPS),
    ("corners", _corners, 0.20, LANE_STEPS),
    ("noise", _noise, 0.10, LANE_STEPS),
    ("long saturation", _saturation, 0.10, LANE_STEPS),
    ("worst case", _worst, 0.04, LANE_STEPS),
    ("squares", _squares, 0.04, LANE_STEPS),
    ("chirps", _chirps, 0.04, LANE_STEPS),
    ("fresh starts", _tracking, 0.05, FRESH_STEPS),
    ("edges of limits", _edges, 0.02, EDGE_STEPS),
    ("limits from afar", _afar, 0.04, LANE_STEPS),
)
ADVERSARIAL = tuple(row for row in MAKERS if row[0] in ("worst case", "squares", "chirps", "long saturation"))
SINGLES = tuple(row for row in MAKERS if row[0] in ("tracking", "corners", "noise", "edges of limits"))

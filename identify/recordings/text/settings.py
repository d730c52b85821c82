"""Count the time of rows below settings that say how far apart they are, as recorders and scopes write them.

A setting is a key and its values, `"HResolution",5.0E-02`, `#CLOCK=50mS`, `X Resolution,5.0E-02` or `XInc:,5E-02`: so
write Yokogawa, Hantek, Owon, Fluke and Agilent. A table that has a time column needs none of it.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from firmloop.identify.error import IdentifyError
from firmloop.identify.printed_units import conversion, is_unit
from firmloop.identify.recordings.columns import called_a_counter, tells_time
from firmloop.identify.recordings.table import Misread, RawTable
from firmloop.identify.recordings.text.cells import bare, is_number

Array = NDArray[np.float64]

_FEWEST = 3  # rows that make a table
_HIGHEST = 200  # lines of settings
_APART = 0.01  # of a row: a column that keeps to the settings so well is the time
_SETTING = re.compile(r'[\s"#%]*([A-Za-z][^,;\t=:"(\[]*)(?:[(\[]([^)\]]*)[)\]])?[\s":=,;\t]*(.*)')
_VALUE = re.compile(r"([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*([A-Za-z\u00b5\u03bc]*)")
# Keys as far as their letters and digits go.
_STEPS = frozenset(
    "hresolution xresolution xinc xincrement xinterval timeinterval timeresolution timeincrement sampleinterval "
    "samplinginterval sampleperiod samplingperiod sampletime samplingtime horizontalresolution deltax deltat dt "
    "abtastintervall abtastzeit abtastperiode messintervall".split()
)
_STEPS_WITH_UNIT = frozenset("clock sampling".split())  # CLOCK may be a time of day, too
_RATES = frozenset("samplerate samplingrate samplefrequency samplingfrequency fs abtastrate abtastfrequenz".split())
_STARTS = frozenset("hoffset xorg xorigin xzero xat0 xstart t0".split())
_TIMES = ("hunit", "xunit", "xunits", "horizontalunit", "horizontalunits")
_NAMES = ("tracename", "label", "labels", "source", "channel", "title")
_UNITS = ("vunit", "yunit", "yunits", "verticalunit", "verticalunits", "units", "unit")
_KEYS = _STEPS | _STEPS_WITH_UNIT | _RATES | _STARTS | {*_TIMES, *_NAMES, *_UNITS}


@dataclass(frozen=True, slots=True)
class _Setting:
    unit: str
    values: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class _Block:
    """Rows below settings, without the columns that are empty; `header` is the line of names, empty where none is."""

    settings: dict[str, _Setting]
    header: tuple[str, ...]
    values: Array
    places: NDArray[np.int64]


def read_settings(lines: Sequence[str]) -> RawTable | Misread | None:
    """Return the table whose time its settings tell, None where they do not, or where it has a time column."""
    if not _known(_settings(lines[:_HIGHEST]), _STEPS | _STEPS_WITH_UNIT | _RATES):
        return None
    blocks = _blocks(lines)
    tables = [_table(block) for block in blocks]
    first, *others = tables or [None]
    if not isinstance(first, RawTable) or not others:
        return first
    for block, table in zip(blocks[1:], others, strict=True):
        alike = isinstance(table, RawTable) and np.array_equal(table.columns[0], first.columns[0])
        if not (isinstance(table, RawTable) and alike) or set(table.names[1:]) & set(first.names[1:]):
            wrong = f"is the first row of the second of {len(blocks)} blocks, which do not go beside one another"
            return Misread(f"line {block.places[0]}", wrong, "write each block into a file of its own")
        units = (*first.units, *table.units[1:])
        first = replace(
            first, names=first.names + table.names[1:], columns=first.columns + table.columns[1:], units=units
        )
    told = f"has {len(blocks)} blocks of rows one below the other, which are columns"
    return replace(first, notes=(*first.notes, told))


def _settings(lines: Sequence[str]) -> dict[str, _Setting]:
    """Return the settings by their keys, of which only letters and digits count, in small letters."""
    found = {}
    for line in lines:
        match = _SETTING.match(line)
        if match is not None:
            mark = next((each for each in "\t;" if each in line), ",")
            values = tuple(map(bare, match.group(3).split(mark)))
            while values and not values[-1]:
                values = values[:-1]
            found[_key(match.group(1))] = _Setting((match.group(2) or "").strip(), values)
    return found


def _known(settings: dict[str, _Setting], keys: Sequence[str] | frozenset[str]) -> _Setting | None:
    held = (key for key in (settings if isinstance(keys, frozenset) else keys) if key in keys and key in settings)
    return next((settings[key] for key in held if settings[key].values), None)


def _blocks(lines: Sequence[str]) -> list[_Block]:
    """Return the rows below each group of settings; nothing where other lines stand among them."""
    cut = [(k, cells) for k, line in enumerate(lines) if (cells := _numbers(line))]
    widths = {len(cells) for _, cells in cut[-_FEWEST:]}
    if len(cut) < _FEWEST or len(widths) > 1:
        return []
    rows = [(k, cells) for k, cells in cut if len(cells) in widths]
    begins = [0, *(n + 1 for n, (one, other) in enumerate(pairwise(rows)) if _said(lines, one[0], other[0]))]
    blocks, above = [], 0
    for begin, end in zip(begins, [*begins[1:], len(rows)], strict=True):
        held = rows[begin:end]
        if end - begin < _FEWEST:  # a setting of numbers alone
            continue
        filled = [j for j in range(len(held[0][1])) if any(cells[j] for _, cells in held)]
        if any(not cells[j] for _, cells in held for j in filled):
            return []
        settings = [line for line in lines[above : held[0][0]] if line.strip()]
        values = np.array([[float(cells[j]) for j in filled] for _, cells in held])
        places = np.array([k + 1 for k, _ in held], dtype=np.int64)
        names = _header(settings[-1], len(held[0][1]), filled) if settings else ()
        blocks.append(_Block(_settings(settings), names, values, places))
        above = held[-1][0] + 1
    if any(line.strip() for line in lines[above:]):
        return []
    return blocks


def _said(lines: Sequence[str], one: int, other: int) -> bool:
    return any(line.strip() for line in lines[one + 1 : other])


def _numbers(line: str) -> tuple[str, ...]:
    """Return the cells of a row of numbers, with points in them, some of which may be empty; nothing otherwise."""
    mark = next((each for each in "\t;," if each in line), ",")
    cells = [bare(cell) for cell in line.split(mark)]
    cells = [cell.replace(",", ".") for cell in cells] if mark != "," else cells
    return tuple(cells) if any(cells) and all(not cell or is_number(cell) for cell in cells) else ()


def _header(line: str, width: int, filled: list[int]) -> tuple[str, ...]:
    """Return the names in the line above the rows, nothing where it is a setting."""
    mark = next((each for each in "\t;," if each in line), ",")
    cells = [bare(cell) for cell in line.split(mark)]
    names = [cells[j] for j in filled] if len(cells) == width else []
    if not any(names) or not all(names[1:]) or any(cells[: filled[0]]) or _key(names[0]) in _KEYS:
        return ()
    return () if any(is_number(name) or re.search(r"[:=]|\d[-/.]\d", name) for name in names) else tuple(names)


def _key(text: str) -> str:
    return re.sub(r"[\W_]", "", text).lower()


def _table(block: _Block) -> RawTable | Misread | None:
    clock = _clock(block.settings)
    if clock is None or isinstance(clock, Misread):
        return clock
    start, step = clock
    names, values = block.header, block.values
    if any(map(tells_time, names)):
        return None
    time = start + step * np.arange(len(values))
    own = bool(np.all(np.abs(np.diff(values[:, 0]) - step) <= _APART * step)) and not names
    if own:
        time, values = values[:, 0], values[:, 1:]
    elif names and called_a_counter(names[0]) and bool(np.all(np.diff(values[:, 0]) == 1.0)):
        names, values = names[1:], values[:, 1:]
    width = values.shape[1]
    if not width:
        return None
    names = names or _values(block.settings, _NAMES, width) or tuple(f"column_{k + 1}" for k in range(width))
    units = tuple(unit.strip("()[]") for unit in _values(block.settings, _UNITS, width, alike=True))
    units = ("s", *(units if units and all(map(is_unit, units)) else ("",) * width))
    told = f"has settings above its rows; time_s is {start:g} s and {step:g} s a row"
    columns = (np.ascontiguousarray(time), *(np.ascontiguousarray(column) for column in values.T))
    return RawTable(("time_s", *names), columns, "line", block.places, units, (told,))


def _values(settings: dict[str, _Setting], keys: tuple[str, ...], width: int, alike: bool = False) -> tuple[str, ...]:
    """Return the values of the first of these settings that has one for each column; where they are `alike`, or one."""
    held = [settings[key].values for key in keys if key in settings]
    held = [values * width if alike and len(values) == 1 else values for values in held]
    return next((values for values in held if len(values) == width and all(values)), ())


def _clock(settings: dict[str, _Setting]) -> tuple[float, float] | Misread | None:
    """Return the start and the step that settings tell, s; several channels may have one each."""
    horizontal = _known(settings, _TIMES)
    unit = horizontal.values[0] if horizontal else "s"
    said = _known(settings, _STEPS)
    steps = _times(said, unit) if said else []
    if not steps and (said := _known(settings, _STEPS_WITH_UNIT)):
        steps = _times(said, "")
    if not steps and (said := _known(settings, _RATES)):
        steps = [1.0 / rate for rate in _rates(said) if rate > 0.0]
    steps = [step for step in steps if step > 0.0]
    if not steps:
        return None
    if max(steps) > (1.0 + _APART) * min(steps):
        wrong = f"says that its channels are read {min(steps):g} s and {max(steps):g} s apart"
        return Misread("", wrong, "export them at one rate, or each into a file of its own")
    begin = _known(settings, _STARTS)
    starts = _times(begin, unit) if begin else []
    return (starts[0] if starts else 0.0), steps[0]


def _times(setting: _Setting, otherwise: str) -> list[float]:
    """Return the values of a setting, s; `otherwise` is their unit where none stands beside them."""
    found = []
    for value in setting.values:
        match = _VALUE.fullmatch(value.strip().replace(",", "."))
        factor = _in_seconds((match.group(2) or setting.unit or otherwise) if match else "")
        if match and factor is not None:
            found.append(float(match.group(1)) * factor)
    return found


def _rates(setting: _Setting) -> list[float]:
    """Return the values of a setting, Hz."""
    found = []
    for value in setting.values:
        match = re.fullmatch(r"([-+.\deE]*\d)\s*([kM]?)(?:Hz|S(?:a(?:mples)?)?/s|SPS)?", value.strip(), re.IGNORECASE)
        if match and is_number(match.group(1)):
            found.append(float(match.group(1)) * {"": 1.0, "k": 1e3, "m": 1e6}[match.group(2).lower()])
    return found


def _in_seconds(unit: str) -> float | None:
    """Return a unit of time in s, as instruments print it: mS, uS; None where it is no time."""
    plain = re.sub(r"(?<=[munk\u00b5\u03bc])S$|^S$", "s", unit.strip())
    try:
        return conversion(plain, "s", "").factor if plain else None
    except IdentifyError:
        return None

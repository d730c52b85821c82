"""Read `[recordings]`: the files, and how their columns become ours."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from firmloop.identify.error import IdentifyError
from firmloop.identify.printed_units import conversion, is_unit
from firmloop.identify.recordings.columns import Column, RowClock, as_a_share, unit_left_out
from firmloop.identify.recordings.hold import HOLDS
from firmloop.identify.units import unit_of
from firmloop.project.table import ProjectTable

_LONGEST_PERIOD = 86400.0  # s
_SAME = 1e-3  # relative: a factor that somebody has rounded


@dataclass(frozen=True, slots=True)
class Recordings:
    """Which files to fit, which only to score, and how to read them."""

    train: tuple[Path, ...]
    test: tuple[Path, ...]
    rename: Mapping[str, Column]  # by a file's column name
    conditioning: ProjectTable
    hold: str = HOLDS[0]  # what an input does between rows
    clock: RowClock | None = None  # in place of a time column
    per_recording: tuple[str, ...] = ()  # values of the plant that may differ from file to file


def read_recordings_part(table: ProjectTable) -> Recordings:
    """Check `[recordings]` of a project.

    Raises
    ------
    ProjectError
        on the first thing that is wrong, with file and line.
    """
    table.only(("train", "test", "rename", "conditioning", "hold", "period_s", "start_s", "per_recording"))
    folder = table.file.parent
    train = tuple(folder / name for name in table.texts("train", 'train = ["steps.csv"]'))
    test = tuple(folder / name for name in table.texts("test", 'test = ["ramp.csv"]'))
    for file in test:
        if os.path.realpath(file) in map(os.path.realpath, train):
            raise table.wrong("test", f"{file.name} is also a train recording; a score needs data that was not fitted")
    hold = str(table.values.get("hold", HOLDS[0]))
    if hold not in HOLDS:
        raise table.wrong("hold", f"is {hold!r}; it must be one of {', '.join(HOLDS)}")
    own = table.texts("per_recording", 'per_recording = ["load_torque_N_m"]')
    rename, conditioning = _rename(table.table("rename")), table.table("conditioning")
    return Recordings(train, test, rename, conditioning, hold, _clock(table), tuple(own))


def _rename(table: ProjectTable) -> Mapping[str, Column]:
    columns: dict[str, Column] = {}
    for key, value in table.values.items():
        column = _column(table.table(key)) if isinstance(value, dict) else _plain(table, key)
        same = [other for other, held in columns.items() if held.name == column.name]
        if same:
            raise table.wrong(key, f"{column.name} is already what '{same[0]}' is called; rename one of the two")
        columns[key] = column
    return columns


def _plain(table: ProjectTable, key: str) -> Column:
    name = table.text(key, f'{key} = "speed_rad_s"')
    line = unit_left_out(key, name)
    if line:
        wanted = unit_of(name)
        raise table.wrong(key, f"the name carries a unit that is not {wanted}; {line}")
    return Column(name)


def _column(table: ProjectTable) -> Column:
    table.only(("name", "unit", "scale", "offset", "wraps"))
    name = table.text("name", 'name = "speed_rad_s"')
    unit = table.text("unit", 'unit = "rpm"') if "unit" in table.values else ""
    wanted, key = unit_of(name), table.place[-1]
    if unit and not wanted:
        raise table.wrong(
            "unit", f"cannot be converted, for {name} ends in no unit; end it in one, such as speed_rad_s"
        )
    if unit:
        try:
            conversion(unit, wanted, f"{name}, unit")
        except IdentifyError as error:
            other = as_a_share(key, name, unit) if is_unit(unit) else ""
            raise table.wrong("unit", f"is of another kind than {wanted}: {other}" if other else str(error)) from None
    scaled = "scale" in table.values or "offset" in table.values
    line = "" if unit or scaled else unit_left_out(key, name)
    if line:
        raise table.remark("name", f"{key} carries a unit that is not {wanted}; {line}")
    numbers = {
        number: table.number(number, f"{number} = 1.0")
        for number in ("scale", "offset", "wraps")
        if number in table.values
    }
    factor = conversion(unit, wanted, name).factor if unit else 1.0
    if factor != 1.0 and abs(numbers.get("scale", 1.0) / factor - 1.0) < _SAME:
        raise table.wrong(
            "scale", f"turns {unit} into {wanted}, as unit does, so that the two would do it twice; leave one out"
        )
    if numbers.get("scale") == 0.0:
        raise table.wrong("scale", "must not be 0: every value would be lost")
    if numbers.get("wraps", 1.0) <= 0.0:
        raise table.wrong("wraps", "must be more than 0: by how much the counter falls, such as 4294967296")
    return Column(name, unit, numbers.get("scale", 1.0), numbers.get("offset", 0.0), numbers.get("wraps", 0.0))


def _clock(table: ProjectTable) -> RowClock | None:
    if "period_s" not in table.values:
        if "start_s" in table.values:
            raise table.wrong("start_s", "is the time of the first row where period_s is given; add period_s = 50e-6")
        return None
    period = table.number("period_s", "period_s = 50e-6")
    if not 0.0 < period <= _LONGEST_PERIOD:
        raise table.wrong("period_s", "must be the time between two rows, more than 0 s and at most a day")
    start = table.number("start_s", "start_s = 0") if "start_s" in table.values else 0.0
    return RowClock(period, start)

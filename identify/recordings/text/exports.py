"""Read the exports of instruments whose files say by themselves where time stands: scopes, and LabVIEW's .lvm."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from firmloop.identify.printed_units import is_unit
from firmloop.identify.recordings.table import Misread, RawTable

Array = NDArray[np.float64]

_ONE_X = "write it with one X column and one segment"
_NUMBER = r"[-+]?[.\d]+(?:[eE][-+]?\d+)?"
_KEEP = "export it again, or save one header line and one line per sample"


def read_export(lines: Sequence[str]) -> RawTable | Misread | None:
    """Return the table of a known instrument, None where its signature is not there."""
    first = next((line for line in lines if line.strip()), "")
    reader = next((read for signature, read in _READERS if re.match(signature, first)), None)
    if reader is None:
        return None
    try:
        return reader(lines)
    except (ValueError, IndexError):
        return Misread("", "is an instrument's export whose header or numbers are damaged", _KEEP)


def _beside_settings(lines: Sequence[str]) -> RawTable | Misread:
    """Take time and voltage from the fourth and fifth cell; the others hold settings, as Tektronix and LeCroy write."""
    cells = [(k + 1, line.split(",")) for k, line in enumerate(lines) if line.strip()]
    source = next((row[1].strip() for _, row in cells if row[0].strip() == "Source"), "") or "CH1"
    rows = [(place, ",".join(row[3:5])) for place, row in cells]
    told = "is an export of Tektronix's kind, with settings beside its rows; time_s is taken from it"
    return _columns(("time_s", source), rows, told, 0.0, 1.0)


def _rigol(lines: Sequence[str]) -> RawTable | Misread:
    """Count time from the start and increment that stand in the second line."""
    (_, head), (_, settings), *rest = ((k + 1, line.split(",")) for k, line in enumerate(lines) if line.strip())
    names = [name.strip() for name in head]
    start, step = (float(settings[names.index(key)]) for key in ("Start", "Increment"))
    width = next(k for k, name in enumerate(names) if name in ("Start", "Increment", ""))
    rows = [(place, ",".join(row[:width])) for place, row in rest]
    said = f"is a Rigol export; time_s is {start:g} s and {step:g} s a row"
    found = _columns(("time_s", *names[1:width]), rows, said, start, step)
    units = tuple(unit.strip().capitalize() for unit in settings[1:width])  # VOLT
    return replace(found, units=("s", *units)) if isinstance(found, RawTable) and all(map(is_unit, units)) else found


def _rigol_even(lines: Sequence[str]) -> RawTable | Misread:
    """Count time from `t0 = ` and `tInc = ` of the header."""
    (_, head), *rest = ((k + 1, line) for k, line in enumerate(lines) if line.strip())
    found = re.search(r"t0\s*=\s*([-+.\deE]+).*?tInc\s*=\s*([-+.\deE]+)", head)
    if found is None:
        return Misread("line 1", "does not hold t0 and tInc of a Rigol export", _KEEP)
    names = tuple(name.strip() for name in head[: found.start()].rstrip(" ,").split(","))
    start, step = float(found.group(1)), float(found.group(2))
    rows = [(place, ",".join([str(k), *row.split(",")[: len(names)]])) for k, (place, row) in enumerate(rest)]
    said = f"is a Rigol export; time_s is {start:g} s and {step:g} s a row"
    return _columns(("time_s", *names), rows, said, start, step)


def _labview(lines: Sequence[str]) -> RawTable | Misread:
    """Read a LabVIEW measurement file: its header says separator, decimal mark and where X stands."""
    ends = [k for k, line in enumerate(lines) if line.startswith("***End_of_Header***")]
    if not ends:
        return Misread("", "is a LabVIEW file whose header does not end", _KEEP)
    named = re.search(r"^Separator[\t,;](\w+)", "\n".join(lines[: ends[-1]]), re.MULTILINE)
    mark = {"Comma": ",", "Semicolon": ";"}.get(named.group(1) if named else "Tab", "\t")
    settings = [line.split(mark) for line in lines[: ends[-1]]]
    said = {row[0].strip(): row[1].strip() for row in settings if len(row) > 1}
    columns, comma = said.get("X_Columns", "One"), said.get("Decimal_Separator", ".") == ","
    body = [(k + 1, line) for k, line in enumerate(lines[ends[-1] + 1 :], ends[-1] + 1) if line.strip()]
    if columns not in ("One", "No", "Multi") or len(body) < 2:
        return Misread("", "is a LabVIEW file that holds no rows", _ONE_X)
    names = [name.strip() for name in body[0][1].split(mark)]
    width = len(names) - (names[-1] == "Comment")
    rows = [(place, line.replace(",", ".") if comma else line) for place, line in body[1:]]
    cut = [(place, ",".join(line.split(mark)[:width])) for place, line in rows]
    told = "is a LabVIEW measurement file; X_Value is taken for time_s"
    if columns == "Multi":
        return _one_x(names[:width], cut, told)
    if columns == "One":
        return _columns(("time_s", *names[1:width]), cut, told, 0.0, 1.0)
    start, step = (float(said.get(key, default).replace(",", ".")) for key, default in (("X0", "0"), ("Delta_X", "1")))
    shift = 1 if names[0] == "X_Value" else 0
    counted = [(place, ",".join([str(k), *row.split(",")[shift:]])) for k, (place, row) in enumerate(cut)]
    return _columns(("time_s", *names[shift:width]), counted, f"{told}, {step:g} s a row", start, step)


def _one_x(names: list[str], rows: list[tuple[int, str]], told: str) -> RawTable | Misread:
    """Take the X columns of a LabVIEW file for one, where they are equal."""
    clocks = [k for k, name in enumerate(names) if name == names[0]]
    kept = [k for k in range(len(names)) if k == 0 or k not in clocks]
    cells = [(place, row.split(",")) for place, row in rows]
    if any(len(row) != len(names) or len({float(row[k]) for k in clocks}) > 1 for _, row in cells):
        return Misread("", "is a LabVIEW file that has a time column for each channel, which differ", _ONE_X)
    cut = [(place, ",".join(row[k] for k in kept)) for place, row in cells]
    return _columns(("time_s", *(names[k] for k in kept[1:])), cut, told, 0.0, 1.0)


def _columns(
    names: tuple[str, ...], rows: list[tuple[int, str]], told: str, start: float, step: float
) -> RawTable | Misread:
    """Parse rows whose first cell times `step` plus `start` is the time, s."""
    for place, row in rows:
        cells = row.split(",")
        if len(cells) != len(names):
            return Misread(f"line {place}", f"has {len(cells)} values for {len(names)} columns", _KEEP)
    if not rows:
        return Misread("", "holds a header but no rows", _KEEP)
    values = np.loadtxt([row for _, row in rows], delimiter=",", comments=None, ndmin=2)
    time = values[:, 0] if (start, step) == (0.0, 1.0) else start + step * values[:, 0]
    columns = (np.ascontiguousarray(time), *(np.ascontiguousarray(column) for column in values.T[1:]))
    return RawTable(names, columns, "line", np.array([place for place, _ in rows], dtype=np.int64), (), (told,))


_READERS: tuple[tuple[str, Callable[[Sequence[str]], RawTable | Misread]], ...] = (
    (rf"[A-Za-z][\w ]*,[^,]*,[^,]*,\s*{_NUMBER}\s*,\s*{_NUMBER}\s*,*\s*$", _beside_settings),
    (r"X,.*Increment", _rigol),
    (r".*t0\s*=.*tInc\s*=", _rigol_even),
    (r"LabVIEW Measurement", _labview),
)

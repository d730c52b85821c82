"""Read MATLAB files, level 5 and 7.3 (HDF5), that hold one vector per column or one structure of vectors."""

from __future__ import annotations

import zlib
from collections.abc import Iterator, Mapping

import numpy as np

from firmloop.identify.recordings.extent import unpacked_mat
from firmloop.identify.recordings.formats import Format
from firmloop.identify.recordings.groups import Group, Vector, table_of_groups, vectors_of
from firmloop.identify.recordings.hdf5_groups import hdf5_groups
from firmloop.identify.recordings.mat_level5 import OBJECT, STRUCTURES, Unread, mat_variables
from firmloop.identify.recordings.table import Misread, RawTable

_HDF5 = b"\x89HDF\r\n\x1a\n"
_DEEPEST = 8  # structures in structures
_REMEDY = "save time_s and each signal as a vector of its own"
_TABLE = (
    "save its columns as a structure: s = table2struct(timetable2table(T), 'ToScalar', true); "
    "s.time_s = seconds(T.Properties.RowTimes); save('r.mat', '-struct', 's'); of a timeseries s.time_s = ts.Time and "
    "s.speed_rad_s = ts.Data, of iddata z s.voltage_V = z.u and s.speed_rad_s = z.y"
)


def read_mat(content: bytes) -> RawTable | Misread:
    """Take every numeric vector of the file, else those of its only structure; text and scalars are left aside."""
    try:
        if _HDF5 in content[:1024]:
            groups = hdf5_groups(content, "a MATLAB 7.3 file")
            opaque = b"MATLAB_object_decode" in content
        else:
            plain = unpacked_mat(content)
            if isinstance(plain, Misread):
                return plain
            found = mat_variables(plain)
            groups = tuple(_groups({name: each for name, each in found.values.items() if name[:2] != "__"}, "", 0))
            groups = groups[:1] if groups and not groups[0].name else groups
            opaque = _holds(found.values, OBJECT, 0)
            if not any(_beside(group) for group in groups) and not opaque:
                return _no_vectors(found.values)
    except (OSError, EOFError, ValueError, TypeError, KeyError, IndexError, zlib.error) as error:
        reason = str(error).partition("\n")[0][:80]
        return Misread("", f"is not a MATLAB file of level 5 or 7.3 ({reason})", "write it with save(..., '-v7')")
    except (RuntimeError, MemoryError) as error:
        return Misread("", f"is a damaged MATLAB file ({error})", "write it again with save(..., '-v7')")
    if isinstance(groups, Misread):
        return groups
    if not groups and opaque:
        return Misread("", "holds a table, a timeseries or another object, which only MATLAB can open", _TABLE)
    if not groups:
        return Misread("", "holds no numeric vector", _REMEDY)
    return table_of_groups(groups, _REMEDY)


def _groups(variables: Mapping[str, object], place: str, depth: int) -> Iterator[Group]:
    """Yield the vectors of a structure, then those of the structures in it."""
    arrays = [(name, value, "") for name, value in variables.items() if isinstance(value, np.ndarray)]
    own = _with_time(variables, place) or vectors_of(arrays)
    if own:
        yield Group(place, own)
    if depth < _DEEPEST:
        for name, value in variables.items():
            if isinstance(value, dict):
                yield from _groups(value, f"{place}.{name}".strip("."), depth + 1)


def _with_time(variables: Mapping[str, object], place: str) -> tuple[Vector, ...]:
    """Return the vectors of what Simulink calls a structure with time, and of what is left of a timeseries.

    That is `time`, and `values` in `signals`; or `Time` and `Data`.
    """
    time, signals = variables.get("time"), variables.get("signals")
    values = signals.get("values") if isinstance(signals, dict) else None
    if "Time" in variables and "Data" in variables:
        time, values = variables["Time"], variables["Data"]
    if not isinstance(time, np.ndarray) or not isinstance(values, np.ndarray) or values.ndim != 2:
        return ()
    rows, name = values if len(values) == time.size else values.T, place.rpartition(".")[2] or "signal"
    if len(rows) != time.size or time.size < 2:
        return ()
    count = rows.shape[1]
    columns = [(f"{name}_{k + 1}" if count > 1 else name, rows[:, k], "") for k in range(count)]
    return vectors_of([("time_s", time, "s"), *columns])


def _beside(group: Group) -> bool:
    return sum(values.ndim == 1 for _, values, _ in group.vectors) > 1


def _holds(variables: Mapping[str, object], what: Unread, depth: int) -> bool:
    inner = [each for each in variables.values() if isinstance(each, dict)]
    return any(each is what for each in variables.values()) or (
        depth < _DEEPEST and any(_holds(each, what, depth + 1) for each in inner)
    )


def _no_vectors(variables: Mapping[str, object]) -> Misread:
    """Say what a file holds instead of vectors beside one another."""
    arrays = {name: each for name, each in variables.items() if isinstance(each, np.ndarray)}
    name = next((name for name, each in arrays.items() if each.ndim == 2 and min(each.shape) > 1), "")
    if name:
        shape = " x ".join(str(each) for each in arrays[name].shape)
        cure = (
            f"save each by its name, as in time_s = {name}(:,1); voltage_V = {name}(:,2); save('r.mat', 'time_s', ...)"
        )
        return Misread("", f"holds {name}, a matrix of {shape}, whose columns have no names", cure)
    if _holds(variables, STRUCTURES, 0):
        return Misread(
            "", "holds an array of structures", "save one of them: s = runs(1); save('r.mat', '-struct', 's')"
        )
    return Misread("", "holds no numeric vectors beside one another", _REMEDY)


FORMAT = Format((".mat",), read_mat)

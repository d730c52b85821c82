"""Read MATLAB files, level 5 and 7.3 (HDF5), that hold one vector per column or one structure of vectors."""

from __future__ import annotations

import zlib
from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np

from firmloop.identify.recordings.extent import unpacked_mat
from firmloop.identify.recordings.formats import Format
from firmloop.identify.recordings.groups import Group, Vector, table_of_groups, vectors_of
from firmloop.identify.recordings.mat_hdf5 import mat73_variables
from firmloop.identify.recordings.mat_level5 import COMPLEX, DEEPEST, OBJECT, mat_variables
from firmloop.identify.recordings.table import Array, Misread, RawTable

_HDF5 = b"\x89HDF\r\n\x1a\n"
_REMEDY = "save time_s and each signal as a vector of its own"
_TABLE = (
    "save its columns as a structure: s = table2struct(timetable2table(T), 'ToScalar', true); "
    "s.time_s = seconds(T.Properties.RowTimes); save('r.mat', '-struct', 's'); of a timeseries s.time_s = ts.Time and "
    "s.speed_rad_s = ts.Data, of iddata z s.voltage_V = z.u and s.speed_rad_s = z.y"
)


def read_mat(content: bytes) -> RawTable | Misread:
    """Take every numeric vector of the file, else those of its only structure; text and scalars are left aside."""
    try:
        reverse = _HDF5 in content[:1024]
        if reverse:
            found = mat73_variables(content)
        else:
            plain = unpacked_mat(content)
            if isinstance(plain, Misread):
                return plain
            found = mat_variables(plain)
    except (OSError, EOFError, ValueError, TypeError, KeyError, IndexError, zlib.error) as error:
        reason = str(error).partition("\n")[0][:80]
        return Misread("", f"is not a MATLAB file of level 5 or 7.3 ({reason})", "write it with save(..., '-v7')")
    except (RuntimeError, MemoryError) as error:
        return Misread("", f"is a damaged MATLAB file ({error})", "write it again with save(..., '-v7')")
    variables = {name: each for name, each in found.values.items() if name[:2] != "__"}
    groups = tuple(_groups(variables, "", 0))
    groups = groups[:1] if groups and not groups[0].name else groups
    inside = (name for name, each in _every(variables, 0) if each is COMPLEX)
    wrong = {name: "holds complex numbers" for name in (*found.complex_names, *inside)}
    if not any(map(_beside, groups)) and not (reverse and any(len(group.vectors) > 1 for group in groups)):
        shown = {name: each.T if reverse and isinstance(each, np.ndarray) else each for name, each in variables.items()}
        return _no_vectors(shown, tuple(wrong))
    table = table_of_groups(groups, _REMEDY)
    return replace(table, words={**table.words, **wrong}) if isinstance(table, RawTable) else table


def _groups(variables: Mapping[str, object], place: str, depth: int) -> Iterator[Group]:
    """Yield the vectors of a structure, then those of the structures in it."""
    arrays = [(name, value, "") for name, value in variables.items() if isinstance(value, np.ndarray)]
    timed = _with_time(variables, place)
    own = timed or vectors_of(arrays)
    if own:
        yield Group(place, own)
    if depth < DEEPEST:
        inner = ((name, value) for name, value in variables.items() if isinstance(value, Mapping))
        for name, value in inner:
            if not timed or name != "signals":
                yield from _groups(value, f"{place}.{name}".strip("."), depth + 1)


def _with_time(variables: Mapping[str, object], place: str) -> tuple[Vector, ...]:
    """Return the vectors of what Simulink calls a structure with time, and of what is left of a timeseries.

    That is `time`, and `values` of `signals`, which are named by `label` where there are several; or `Time` and `Data`.
    """
    time, signals = variables.get("time"), variables.get("signals")
    each = [signals] if isinstance(signals, Mapping) else list(signals) if isinstance(signals, tuple) else []
    if "Time" in variables and "Data" in variables:
        time, each = variables["Time"], [{"values": variables["Data"]}]
    if not isinstance(time, np.ndarray) or time.size < 2 or not each:
        return ()
    name = place.rpartition(".")[2] or "signal"
    columns: list[tuple[str, Array]] = []
    for signal in each:
        values, label = signal.get("values"), signal.get("label") if len(each) > 1 else ""
        values = np.squeeze(values) if isinstance(values, np.ndarray) else np.zeros(0)
        if values.ndim > 2 or time.size not in values.shape:
            return ()
        rows = values.reshape(time.size, -1) if len(values) == time.size else values.T
        columns += [(label if isinstance(label, str) else "", np.asarray(column)) for column in rows.T]
    said = [label for label, _ in columns]
    named = [
        label if label and said.count(label) == 1 else f"{label or name}_{k + 1}" if len(columns) > 1 else label or name
        for k, label in enumerate(said)
    ]
    return vectors_of([("time_s", time, "s"), *((n, v, "") for n, (_, v) in zip(named, columns, strict=True))])


def _beside(group: Group) -> bool:
    return sum(values.ndim == 1 for _, values, _ in group.vectors) > 1


def _every(variables: Mapping[str, object], depth: int) -> Iterator[tuple[str, object]]:
    """Yield all variables by name, then those of the structures among them."""
    yield from variables.items()
    for each in variables.values():
        if depth < DEEPEST and isinstance(each, Mapping):
            yield from _every(each, depth + 1)


def _no_vectors(variables: Mapping[str, object], complex_names: tuple[str, ...]) -> Misread:
    """Say what a file holds instead of vectors beside one another."""
    every = [each for _, each in _every(variables, 0)]
    if any(each is OBJECT for each in every):
        return Misread("", "holds a table, a timeseries or another object, which only MATLAB can open", _TABLE)
    if complex_names:
        name = complex_names[0]
        cure = f"save what is measured, as in {name} = real({name}); save('r.mat', '{name}', ...)"
        return Misread("", f"holds complex numbers: {', '.join(complex_names)[:80]}", cure)
    arrays = {name: each for name, each in variables.items() if isinstance(each, np.ndarray)}
    name = next((name for name, each in arrays.items() if each.ndim == 2 and min(each.shape) > 1), "")
    if name:
        shape = " x ".join(str(each) for each in arrays[name].shape)
        cure = (
            f"save each by its name, as in time_s = {name}(:,1); voltage_V = {name}(:,2); save('r.mat', 'time_s', ...)"
        )
        return Misread("", f"holds {name}, a matrix of {shape}, whose columns have no names", cure)
    if any(isinstance(each, tuple) for each in every):
        return Misread(
            "", "holds an array of structures", "save one of them: s = runs(1); save('r.mat', '-struct', 's')"
        )
    return Misread("", "holds no numeric vectors beside one another", _REMEDY)


FORMAT = Format((".mat",), read_mat)

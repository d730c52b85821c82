"""MATLAB files of version 7.3: structures with time, arrays of structures, and what is no column is named."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from firmloop.identify.error import IdentifyError
from firmloop.identify.recordings.recording import column, read_recording

h5py = pytest.importorskip("h5py", reason="h5py is not installed (pip install 'firmloop[hdf5]')")

TIME = 0.01 * np.arange(50)
VOLTS, SPEED = np.where(TIME < 0.2, 0.0, 6.0), 100.0 * np.sin(TIME)
NAMES = ("voltage_V", "speed_rad_s")


def put(group: Any, name: str, value: object) -> Any:
    """Store a column, a matrix or a text as MATLAB does: with its sizes in reverse, text as numbers."""
    kind = "char" if isinstance(value, str) else "double"
    letters = [[ord(letter)] for letter in value] if isinstance(value, str) else value
    stored = np.asarray(letters, dtype=np.uint16 if kind == "char" else None)
    if np.iscomplexobj(stored):
        parts = np.zeros(stored.shape, [("real", "f8"), ("imag", "f8")])
        parts["real"], parts["imag"] = stored.real, stored.imag
        stored = parts
    item = group.create_dataset(name, data=stored if kind == "char" else stored.reshape(len(stored), -1).T)
    item.attrs["MATLAB_class"] = np.bytes_(kind)
    return item


def a_matrix(file: Any) -> None:
    signals = file.create_group("log").create_group("signals")
    put(file["log"], "time", TIME)
    put(signals, "values", np.column_stack([VOLTS, SPEED]))


def an_array(file: Any) -> None:
    signals, kept = file.create_group("log").create_group("signals"), file.create_group("#refs#")
    put(file["log"], "time", TIME)
    for field, values in (("values", (VOLTS, SPEED)), ("label", NAMES)):
        references = [put(kept, f"{field}{k}", value).ref for k, value in enumerate(values)]
        signals.create_dataset(field, (2, 1), dtype=h5py.ref_dtype)[:, 0] = references


def complex_speed(file: Any) -> None:
    for name, values in zip(("time_s", *NAMES), (TIME, VOLTS, SPEED + 1j), strict=True):
        put(file, name, values)


def one_matrix(file: Any) -> None:
    put(file, "data", np.column_stack([TIME, VOLTS, SPEED]))


def a_circle(file: Any) -> None:
    """Store an array of structures, every one of which is the whole array."""
    group = file.create_group("log")
    for field in ("first", "next"):
        group.create_dataset(field, (1000, 1), dtype=h5py.ref_dtype)[:, 0] = [group.ref] * 1000


def saved(folder: Path, build: Callable[[Any], None]) -> Path:
    path = folder / "r.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        build(file)
    return path


@pytest.mark.parametrize(("build", "names"), [(a_matrix, ("log_1", "log_2")), (an_array, NAMES)])
def test_a_structure_with_time_is_read(build: Callable[[Any], None], names: tuple[str, str], tmp_path: Path) -> None:
    found = read_recording(saved(tmp_path, build), {})
    assert np.array_equal(found.time, TIME)
    assert np.array_equal(column(found, names[0]), VOLTS) and np.array_equal(column(found, names[1]), SPEED)


@pytest.mark.parametrize(
    ("build", "words"),
    [
        (complex_speed, "speed_rad_s is no column of numbers, it holds complex numbers"),
        (one_matrix, "holds data, a matrix of 50 x 3, whose columns have no names"),
    ],
)
def test_what_is_no_column_is_named(build: Callable[[Any], None], words: str, tmp_path: Path) -> None:
    with pytest.raises(IdentifyError, match=words):
        column(read_recording(saved(tmp_path, build), {}), "speed_rad_s")


def test_structures_that_hold_themselves_are_refused(tmp_path: Path) -> None:
    with pytest.raises(IdentifyError, match="its structures refer to more than 100,000 values"):
        read_recording(saved(tmp_path, a_circle), {})

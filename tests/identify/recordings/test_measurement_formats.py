"""One recording through the files of instruments, MATLAB and flight controllers: equal values, or a sentence."""

from __future__ import annotations

import io
import struct
import sys
from collections.abc import Callable, Mapping
from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy

from firmloop.identify.error import IdentifyError
from firmloop.identify.extras import ToolError
from firmloop.identify.recordings.columns import Column
from firmloop.identify.recordings.recording import Recording, read_recording

Columns = Mapping[str, np.ndarray]
ROWS = 50
COLUMNS: Columns = {
    "time_s": np.arange(ROWS) * 0.01,
    "voltage_V": np.sin(np.arange(ROWS) / 7.0),
    "speed_rad_s": np.random.default_rng(3).normal(size=ROWS),
}


def hdf5(folder: str, units: Mapping[str, str], columns: Columns = COLUMNS) -> bytes:
    buffer = io.BytesIO()
    with h5py.File(buffer, "w") as file:
        file["note"] = "bench 3"
        for name, values in columns.items():
            item = file.create_dataset(f"{folder}/{name}", data=values)
            if name in units:
                item.attrs["units"] = units[name]
    return buffer.getvalue()


def mat(variables: Mapping[str, object]) -> bytes:
    buffer = io.BytesIO()
    scipy.io.savemat(buffer, variables)
    return buffer.getvalue()


def mat73(folder: str, text: str = "") -> bytes:
    buffer = io.BytesIO()
    with h5py.File(buffer, "w", userblock_size=512) as file:
        for name, values in COLUMNS.items():
            file.create_dataset(f"{folder}/{name}", data=values[None, :])
        if text:
            file.create_dataset("note", data=np.frombuffer(text.encode("utf-16-le"), np.uint16))
            file["note"].attrs["MATLAB_class"] = np.bytes_("char")
    return buffer.getvalue()


def tdms(path: Path, waveform: bool) -> None:
    nptdms = pytest.importorskip("nptdms", reason="npTDMS is not installed (pip install 'firmloop[tdms]')")
    clock = {"wf_increment": 0.01, "wf_start_offset": 0.0} if waveform else {}
    names = [name for name in COLUMNS if not waveform or name != "time_s"]
    with nptdms.TdmsWriter(str(path)) as writer:
        writer.write_segment([nptdms.ChannelObject("log", name, COLUMNS[name], clock) for name in names])


def mdf(path: Path, columns: Columns = COLUMNS, slow: bool = False) -> None:
    asammdf = pytest.importorskip("asammdf", reason="asammdf is not installed (pip install 'firmloop[mdf4]')")
    time = columns["time_s"]
    with asammdf.MDF(version="4.10") as file:
        for name, values in columns.items():
            if name != "time_s":
                step = 5 if slow and name == "speed_rad_s" else 1
                file.append(asammdf.Signal(samples=values[::step], timestamps=time[::step], name=name))
        file.save(path, overwrite=True)


def ulog(topics: Mapping[str, tuple[np.ndarray, Columns]]) -> bytes:
    """Write a log as its format says: definitions, then messages in the order of time."""

    def message(kind: str, content: bytes) -> bytes:
        return struct.pack("<HB", len(content), ord(kind)) + content

    out = [b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0), message("B", bytes(40))]
    for name, (_, fields) in topics.items():
        out.append(message("F", f"{name}:uint64_t timestamp;{''.join(f'double {each};' for each in fields)}".encode()))
    data = []
    for number, (name, (stamps, fields)) in enumerate(topics.items()):
        out.append(message("A", struct.pack("<BH", 0, number) + name.encode()))
        for k, stamp in enumerate(stamps):
            values = [float(each[k]) for each in fields.values()]
            data.append((int(stamp), message("D", struct.pack(f"<HQ{len(values)}d", number, int(stamp), *values))))
    return b"".join([*out, *(each for _, each in sorted(data, key=lambda one: one[0]))])


def flight(path: Path) -> None:
    pytest.importorskip("pyulog", reason="pyulog is not installed (pip install 'firmloop[ulog]')")
    fields = {name: values for name, values in COLUMNS.items() if name != "time_s"}
    path.write_bytes(ulog({"motor": (np.round(COLUMNS["time_s"] * 1e6), fields)}))


def bytes_of(content: bytes) -> Callable[[Path], None]:
    return lambda path: path.write_bytes(content) and None


WRITERS: dict[str, Callable[[Path], None]] = {
    "top.h5": bytes_of(hdf5("", {})),
    "group.hdf5": bytes_of(hdf5("run/bench", {"voltage_V": "V"})),
    "struct.mat": bytes_of(mat({"data": COLUMNS, "note": "bench 3"})),
    "nested.mat": bytes_of(mat({"run": {"info": {"rate": 100.0}, "log": COLUMNS}})),
    "struct73.mat": bytes_of(mat73("data")),
    "text73.mat": bytes_of(mat73("", "a note of text")),
    "channels.tdms": lambda path: tdms(path, waveform=False),
    "waveform.tdms": lambda path: tdms(path, waveform=True),
    "r.mf4": mdf,
    "r.ulg": flight,
}


def read(path: Path, rename: Mapping[str, Column] | None = None) -> Recording:
    return read_recording(path, rename or {})


@pytest.mark.parametrize("name", WRITERS)
def test_every_file_gives_the_same_recording(name: str, tmp_path: Path) -> None:
    WRITERS[name](tmp_path / name)
    recording = read(tmp_path / name)
    np.testing.assert_allclose(recording.time, COLUMNS["time_s"], rtol=0.0, atol=1e-12)
    assert set(recording.columns) == {"voltage_V", "speed_rad_s"}
    for signal, values in recording.columns.items():
        np.testing.assert_array_equal(values, COLUMNS[signal])


def test_units_of_a_file_are_taken(tmp_path: Path) -> None:
    columns = {"t": COLUMNS["time_s"] * 1e3, "voltage_V": COLUMNS["voltage_V"]}
    (tmp_path / "r.h5").write_bytes(hdf5("", {"t": "ms"}, columns))
    recording = read(tmp_path / "r.h5", {"t": Column("time_s")})
    np.testing.assert_allclose(recording.time, COLUMNS["time_s"], atol=1e-12)


def test_topics_of_a_flight_log_are_held_on_the_quickest(tmp_path: Path) -> None:
    pytest.importorskip("pyulog")
    stamps = np.arange(100) * 1000 + 5000
    topics = {
        "command": (stamps[::10], {"voltage_V": np.arange(10.0)}),
        "motor": (stamps + 1, {"speed_rad_s": np.arange(100.0)}),
    }
    (tmp_path / "r.ulg").write_bytes(ulog(topics))
    recording = read(tmp_path / "r.ulg")
    assert len(recording.time) == 100
    np.testing.assert_array_equal(recording.columns["command.voltage_V"], np.repeat(np.arange(10.0), 10))
    np.testing.assert_array_equal(recording.columns["motor.speed_rad_s"], np.arange(100.0))
    assert "held from message to message" in recording.notes[0]


def test_several_rates_are_named_with_the_cure(tmp_path: Path) -> None:
    mdf(tmp_path / "r.mf4", slow=True)
    with pytest.raises(
        IdentifyError, match=r"2 tables.*50 rows of time_s, voltage_V.*10 rows.*resample\(raster=0\.001\)"
    ):
        read(tmp_path / "r.mf4")


def test_several_groups_are_named(tmp_path: Path) -> None:
    (tmp_path / "r.mat").write_bytes(mat({"first": COLUMNS, "second": COLUMNS}))
    with pytest.raises(IdentifyError, match=r"holds 2 tables.*first: 50 rows of time_s.*second: 50 rows"):
        read(tmp_path / "r.mat")


def test_a_timetable_is_told_how_it_can_be_saved(tmp_path: Path) -> None:
    buffer = io.BytesIO()
    with h5py.File(buffer, "w", userblock_size=512) as file:
        table = file.create_dataset("T", data=np.arange(6, dtype=np.uint32)[None, :])
        table.attrs["MATLAB_class"] = np.bytes_("timetable")
        table.attrs["MATLAB_object_decode"] = np.int32(3)
        file["#subsystem#/MCOS"] = np.arange(9.0)
    (tmp_path / "r.mat").write_bytes(buffer.getvalue())
    with pytest.raises(IdentifyError, match=r"timetable.*table2struct.*time_s = seconds"):
        read(tmp_path / "r.mat")


EXTRAS = {
    "r.h5": ("h5py", "hdf5"),
    "r.tdms": ("nptdms", "tdms"),
    "r.mf4": ("asammdf", "mdf4"),
    "r.ulg": ("pyulog", "ulog"),
}


@pytest.mark.parametrize("name", EXTRAS)
def test_a_missing_library_is_named_with_its_extra(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    library, which = EXTRAS[name]
    monkeypatch.setitem(sys.modules, library, None)
    (tmp_path / name).write_bytes(b"anything")
    with pytest.raises(ToolError, match=rf"{library}, which is not installed.*pip install 'firmloop\[{which}\]'"):
        read(tmp_path / name)


@pytest.mark.parametrize("name", EXTRAS)
@pytest.mark.parametrize(
    "content", [b"no such file", b"\x89HDF\r\n\x1a\n" + bytes(40), b"TDSm" + bytes(60), b"MDF     4.10"]
)
def test_damaged_files_are_refused_by_name(name: str, content: bytes, tmp_path: Path) -> None:
    pytest.importorskip(EXTRAS[name][0])
    (tmp_path / name).write_bytes(content)
    with pytest.raises(IdentifyError, match=name):
        read(tmp_path / name)

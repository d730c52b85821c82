"""One recording through the files of instruments, MATLAB and flight controllers: equal values, or a sentence."""

from __future__ import annotations

import importlib
import io
import json
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


def mcap_of(topics: Mapping[str, tuple[np.ndarray, Columns]]) -> bytes:
    """Messages in JSON, in the order of time; `topics` holds stamps in s and fields."""
    writer_of = pytest.importorskip("mcap.writer", reason="mcap is not installed (pip install 'firmloop[mcap]')")
    buffer, sent = io.BytesIO(), []
    writer = writer_of.Writer(buffer)
    writer.start()
    for topic, (stamps, fields) in topics.items():
        schema = writer.register_schema(topic, "jsonschema", b"{}")
        channel = writer.register_channel(topic, "json", schema)
        for k, stamp in enumerate(stamps):
            values = {"note": "x", **{name: float(each[k]) for name, each in fields.items()}}
            sent.append((17 * 10**17 + round(stamp * 1e9), channel, json.dumps(values).encode()))
    for moment, channel, content in sorted(sent):
        writer.add_message(channel, log_time=moment, data=content, publish_time=moment)
    writer.finish()
    return buffer.getvalue()


SIGNALS = {name: values for name, values in COLUMNS.items() if name != "time_s"}


def slow_mcap(path: Path) -> None:
    topics = {
        f"/{name}": (COLUMNS["time_s"][::step], {"data": COLUMNS[name][::step]})
        for name, step in (("voltage_V", 1), ("speed_rad_s", 5))
    }
    path.write_bytes(mcap_of(topics))


def bag(path: Path) -> None:
    """A bag of ROS 1, or of ROS 2 in either of its files; its stamps are of the measurement, its log is late."""
    rosbags = pytest.importorskip("rosbags.typesys", reason="rosbags is not installed (pip install 'firmloop[rosbag]')")
    one = path.suffix == ".bag"
    store = rosbags.get_typestore(rosbags.Stores.ROS1_NOETIC if one else rosbags.Stores.LATEST)
    store.register(rosbags.get_types_from_msg(MOTOR, "bench/msg/Motor"))
    motor, header, stamp = (
        store.types[name] for name in ("bench/msg/Motor", "std_msgs/msg/Header", "builtin_interfaces/msg/Time")
    )
    written = importlib.import_module("rosbags.rosbag1" if one else "rosbags.rosbag2")
    plain = {".mcap": "MCAP", ".db3": "SQLITE3"}.get(path.suffix, "")
    kind = {"version": 9, "storage_plugin": getattr(written.StoragePlugin, plain)} if plain else {}
    place = path if one else path.with_suffix("")
    with written.Writer(place, **kind) as writer:
        link = writer.add_connection("/motor", motor.__msgtype__, typestore=store)
        for k, t in enumerate(COLUMNS["time_s"]):
            first = {"seq": k} if one else {}
            at = header(**first, stamp=stamp(sec=1_700_000_000, nanosec=round(t * 1e9)), frame_id="")
            sent = motor(header=at, voltage_V=COLUMNS["voltage_V"][k], speed_rad_s=COLUMNS["speed_rad_s"][k])
            packed = (store.serialize_ros1 if one else store.serialize_cdr)(sent, motor.__msgtype__)
            writer.write(link, 1_700_000_001 * 10**9 + round(t * 1e9) + k % 3 * 10**6, packed)
    if not one:
        next(place.glob(f"*{path.suffix}")).rename(path)


MOTOR = "std_msgs/Header header\nfloat64 voltage_V\nfloat64 speed_rad_s\n"


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
    "r.bag": bag,
    "r.db3": bag,
    "ros2.mcap": bag,
}


def read(path: Path, rename: Mapping[str, Column] | None = None) -> Recording:
    return read_recording(path, rename or {})


@pytest.mark.parametrize("name", WRITERS)
def test_every_file_gives_the_same_recording(name: str, tmp_path: Path) -> None:
    WRITERS[name](tmp_path / name)
    recording = read(tmp_path / name)
    np.testing.assert_allclose(recording.time, COLUMNS["time_s"], rtol=0.0, atol=1e-12)
    assert set(recording.columns) - {"header.seq"} == {"voltage_V", "speed_rad_s"}
    for signal, values in SIGNALS.items():
        np.testing.assert_array_equal(recording.columns[signal], values)


def test_dates_text_and_single_values_of_a_table_are_read_or_left_aside(tmp_path: Path) -> None:
    buffer = io.BytesIO()
    stamps = np.datetime64("2024-12-31T23:59:59.9", "ns") + np.round(COLUMNS["time_s"] * 1e9).astype("timedelta64[ns]")
    np.savez(buffer, time_s=stamps, voltage_V=COLUMNS["voltage_V"], note="bench 3", rate=100.0)
    (tmp_path / "r.npz").write_bytes(buffer.getvalue())
    recording = read(tmp_path / "r.npz")
    np.testing.assert_allclose(recording.time, COLUMNS["time_s"], atol=1e-9)
    assert recording.notes == ("r.npz holds note, rate beside its columns, left aside",)


def test_row_numbers_without_a_name_are_left_aside(tmp_path: Path) -> None:
    rows = (f"{k},{t:.2f},{u:.9g}" for k, (t, u) in enumerate(zip(*list(COLUMNS.values())[:2], strict=True)))
    (tmp_path / "r.csv").write_text("\n".join([",time_s,voltage_V", *rows]))
    recording = read(tmp_path / "r.csv")
    assert list(recording.columns) == ["voltage_V"] and "row numbers" in recording.notes[0]


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
    assert "held from sample to sample" in recording.notes[0] and "0.005 s at most" in recording.notes[0]


def slow_mdf(path: Path) -> None:
    mdf(path, slow=True)


def slow_tdms(path: Path) -> None:
    nptdms = pytest.importorskip("nptdms", reason="npTDMS is not installed (pip install 'firmloop[tdms]')")
    with nptdms.TdmsWriter(str(path)) as writer:
        for name, step in (("voltage_V", 1), ("speed_rad_s", 5)):
            clock = {"wf_increment": 0.01 * step, "wf_start_offset": 0.0}
            writer.write_segment([nptdms.ChannelObject(f"every_{step}", name, COLUMNS[name][::step], clock)])


@pytest.mark.parametrize(("name", "write"), [("r.mf4", slow_mdf), ("r.tdms", slow_tdms), ("r.mcap", slow_mcap)])
def test_several_rates_are_held_on_the_quickest_and_told(
    name: str, write: Callable[[Path], None], tmp_path: Path
) -> None:
    write(tmp_path / name)
    recording = read(tmp_path / name)
    np.testing.assert_allclose(recording.time, COLUMNS["time_s"], atol=1e-12)
    np.testing.assert_array_equal(recording.columns["voltage_V"], COLUMNS["voltage_V"])
    np.testing.assert_array_equal(recording.columns["speed_rad_s"], np.repeat(COLUMNS["speed_rad_s"][::5], 5))
    assert "comes late by half its own step, 0.025 s at most" in recording.notes[0]


def test_messages_in_messages_are_named_by_their_path(tmp_path: Path) -> None:
    body = {"pose": {"x": 1.0, "covariance": [0.5] * 100}, "joints": [1, 2], "on": True, "name": "arm"}
    writer_of = pytest.importorskip("mcap.writer")
    with (tmp_path / "r.mcap").open("wb") as file:
        writer = writer_of.Writer(file)
        writer.start()
        for topic in ("/arm", "/tool/state"):
            channel = writer.register_channel(topic, "json", writer.register_schema(topic, "jsonschema", b"{}"))
            for k in range(5):
                writer.add_message(channel, k * 10**7, json.dumps(body).encode(), k * 10**7)
        writer.finish()
    fields = ("pose.x", "joints.0", "joints.1", "on")
    assert list(read(tmp_path / "r.mcap").columns) == [
        f"{at}.{each}" for at in ("arm", "tool/state") for each in fields
    ]


def test_groups_with_the_same_names_are_two_recordings(tmp_path: Path) -> None:
    asammdf = pytest.importorskip("asammdf")
    with asammdf.MDF(version="4.10") as file:
        for step in (1, 5):
            file.append(asammdf.Signal(COLUMNS["voltage_V"][::step], COLUMNS["time_s"][::step], name="voltage_V"))
        file.save(tmp_path / "r.mf4")
    with pytest.raises(IdentifyError, match=r"2 tables.*50 rows.*10 rows.*resample\(raster=0\.001\)"):
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
    "r.mcap": ("mcap", "mcap"),
    "r.bag": ("rosbags", "rosbag"),
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

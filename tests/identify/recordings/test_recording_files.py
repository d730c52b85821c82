"""Recordings in every format, and every way in which a file can be wrong."""

from __future__ import annotations

import bz2
import gzip
import hashlib
import io
import time
import tomllib
from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.io

from firmloop.identify.error import IdentifyError
from firmloop.identify.extras import ToolError
from firmloop.identify.recordings.columns import Column
from firmloop.identify.recordings.recording import column, make_recording, read_recording, write_recording

GOOD = "time_s,voltage_V,speed_rad_s\n0,1,0\n0.1,1,2.5\n0.2,-1,4\n0.35,0,3\n"


def npz(**arrays: object) -> bytes:
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)
    return buffer.getvalue()


def lines(*changed: tuple[int, str]) -> bytes:
    rows = GOOD.splitlines()
    for number, text in changed:
        rows[number - 1] = text
    return "\n".join([*rows, ""]).encode()


def mat73(**arrays: np.ndarray) -> bytes:
    buffer = io.BytesIO()
    with h5py.File(buffer, "w", userblock_size=512) as file:
        for name, array in arrays.items():
            file[name] = array
    return buffer.getvalue()


BAD = {
    "empty file": ("r.csv", b"", ["is empty"]),
    "blank lines only": ("r.csv", b"\n \n\n", ["is empty"]),
    "header only": ("r.csv", b"time_s,voltage_V\n", ["no rows"]),
    "two rows": ("r.csv", b"time_s,voltage_V\n0,1\n1,1\n", ["2 rows", "at least 3"]),
    "no time_s": ("r.csv", lines((1, "t,voltage_V,speed_rad_s")), ["time_s is missing", "rename"]),
    "duplicate column": ("r.csv", lines((1, "time_s,voltage_V,voltage_V")), ["voltage_V stands twice"]),
    "renamed onto another": (
        "r.csv",
        lines((1, "time_s,voltage_V,foreign")),
        ["voltage_V stands twice", "'voltage_V' (column 2)", "'foreign' (column 3, renamed)"],
    ),
    "nameless column": ("r.csv", lines((1, "time_s,,speed_rad_s")), ["column 2 has no name"]),
    "row too short": ("r.csv", lines((3, "0.1,1")), ["line 3", "2 values", "3 columns"]),
    "row too long": ("r.csv", lines((4, "0.2,1,2,3")), ["line 4", "4 values"]),
    "all rows short": (
        "r.csv",
        b"time_s,voltage_V,x\n0,1\n1,1\n2,1\n",
        ["line 1", "3 names above 2 values in every row"],
    ),
    "word": ("r.csv", lines((4, "0.2,stop,4")), ["line 4", "column voltage_V", "'stop'"]),
    "empty cell": ("r.csv", lines((4, "0.2,,4")), ["line 4", "column voltage_V", "is empty"]),
    "quoted number": ("r.csv", lines((4, '0.2,"1",4')), ["line 4", "column voltage_V", "quotes"]),
    "underscored number": ("r.csv", lines((4, "0.2,1_000,4")), ["line 4", "column voltage_V", "1_000"]),
    "NaN": ("r.csv", lines((3, "0.1,1,nan")), ["line 3", "column speed_rad_s", "nan"]),
    "infinity": ("r.csv", lines((3, "0.1,inf,1")), ["line 3", "column voltage_V", "inf"]),
    "NaN below a blank line": ("r.csv", lines((3, ""), (4, "0.2,1,nan"), (5, "1,1,1\n2,1,1")), ["line 4"]),
    "time stands still": ("r.csv", lines((4, "0.1,-1,4")), ["line 4", "column time_s", "0.1", "must rise"]),
    "time goes back": ("r.csv", lines((4, "0.05,-1,4")), ["line 4", "0.05", "0.1"]),
    "binary": ("r.csv", bytes(range(256)) * 4, ["is not text"]),
    "NUL bytes": ("r.csv", b"time_s,voltage_V\n0,1\n\x00\x00\n", ["is not text"]),
    "gz that is none": ("r.csv.gz", GOOD.encode(), ["gzip"]),
    "gz cut short": ("r.csv.gz", gzip.compress(GOOD.encode())[:-20], ["gzip"]),
    "gz of junk": ("r.csv.gz", gzip.compress(b"\xff\xfe\xfd"), ["is not text"]),
    "gz called CSV, cut short": ("r.csv", gzip.compress(GOOD.encode())[:-20], ["not a complete gzip file"]),
    "zip called CSV": ("r.csv", npz(time_s=np.arange(3.0)), ["is a zip archive", "export its sheet as CSV"]),
    "bzip2 called CSV": ("r.csv", bz2.compress(GOOD.encode()), ["is packed by bzip2", "gzip"]),
    "HDF5 called CSV": ("r.csv", b"\x89HDF\r\n\x1a\n" + bytes(50), ["is an HDF5 file", "call it .h5"]),
    "npz that is none": ("r.npz", b"PK\x03\x04 no archive", [".npz"]),
    "npz unequal": ("r.npz", npz(time_s=np.arange(5.0), voltage_V=np.zeros(4)), ["column voltage_V", "4 rows"]),
    "npz of matrices": ("r.npz", npz(time_s=np.arange(5.0), voltage_V=np.zeros((5, 2))), ["5x2", "voltage_V"]),
    "npz of text": ("r.npz", npz(time_s=np.arange(3.0), voltage_V=np.array(["a", "b", "c"])), ["voltage_V", "numbers"]),
    "npz of objects": ("r.npz", npz(time_s=np.array([None, {}], dtype=object)), ["plain numbers"]),
    "npz with NaN": ("r.npz", npz(time_s=np.arange(3.0), voltage_V=np.array([0, np.nan, 1])), ["row 2", "voltage_V"]),
    "mat that is none": ("r.mat", b"MATLAB no file" * 30, ["MATLAB"]),
    "mat cut short": ("r.mat", b"\x89HDF\r\n\x1a\n" + bytes(50), ["MATLAB"]),
    "mat without vectors": ("r.mat", mat73(rate=np.array(5.0)), ["no numeric vector"]),
    "mat of a matrix": ("r.mat", mat73(time_s=np.arange(6.0), x_V=np.zeros((3, 2))), ["column x_V", "3x2"]),
    "parquet that is none": ("r.parquet", b"PAR1 no table PAR1", ["Parquet"]),
    "unknown ending": ("r.xlsx", b"1", ["ending is unknown", ".csv.gz"]),
    "no ending": ("recording", b"1", ["ending is unknown"]),
}


def test_a_gzip_file_that_is_called_csv_is_unpacked(tmp_path: Path) -> None:
    (tmp_path / "r.csv").write_bytes(gzip.compress(GOOD.encode()))
    (tmp_path / "s.csv").write_bytes(GOOD.encode())
    packed, plain = (read_recording(tmp_path / name, {}) for name in ("r.csv", "s.csv"))
    assert packed.time.tolist() == plain.time.tolist() and set(packed.columns) == set(plain.columns)


@pytest.mark.parametrize("case", BAD)
def test_malformed_recording_is_refused_by_name(tmp_path: Path, case: str) -> None:
    name, content, words = BAD[case]
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(IdentifyError) as refused:
        read_recording(path, {"foreign": Column("voltage_V")})
    message = str(refused.value)
    assert message.startswith(str(path))
    for word in words:
        assert word in message
    assert len(refused.value.args[0].splitlines()) == 1  # and what to paste is TOML
    tomllib.loads(refused.value.paste)


def test_missing_file_and_folder_are_refused(tmp_path: Path) -> None:
    with pytest.raises(IdentifyError, match="no such file"):
        read_recording(tmp_path / "none.csv", {})
    (tmp_path / "folder.csv").mkdir()
    with pytest.raises(IdentifyError, match="is a folder; give a file"):
        read_recording(tmp_path / "folder.csv", {})


def test_missing_column_lists_those_there_are(tmp_path: Path) -> None:
    (tmp_path / "r.csv").write_text(GOOD)
    with pytest.raises(IdentifyError, match="current_A is missing; it has voltage_V, speed_rad_s"):
        column(read_recording(tmp_path / "r.csv", {}), "current_A")


@pytest.mark.parametrize("dress", ["plain", "bom", "crlf", "spaces", "blank lines", "no last newline", "quoted names"])
def test_csv_dialects_read_alike(tmp_path: Path, dress: str) -> None:
    text = {
        "plain": GOOD,
        "bom": "\ufeff" + GOOD,
        "crlf": GOOD.replace("\n", "\r\n"),
        "spaces": GOOD.replace(",", " , "),
        "blank lines": GOOD.replace("\n", "\n\n"),
        "no last newline": GOOD.rstrip("\n"),
        "quoted names": GOOD.replace("voltage_V", '"voltage_V"'),
    }[dress]
    path = tmp_path / "r.csv"
    path.write_bytes(text.encode())
    recording = read_recording(path, {})
    np.testing.assert_array_equal(recording.time, [0, 0.1, 0.2, 0.35])
    np.testing.assert_array_equal(recording.columns["speed_rad_s"], [0, 2.5, 4, 3])
    assert [(s.name, s.unit, s.low, s.high) for s in recording.signals] == [
        ("voltage_V", "V", -1.0, 1.0),
        ("speed_rad_s", "rad/s", 0.0, 4.0),
    ]
    assert recording.sha256 == hashlib.sha256(text.encode()).hexdigest()


def columns_of(rows: int) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(3)
    return {
        "time_s": np.cumsum(rng.uniform(0.5e-3, 2e-3, rows)),
        "voltage_V": rng.normal(size=rows) * 10.0,
        "current_A": rng.normal(size=rows) * 1e-9,
    }


def write_parquet(path: Path, columns: dict[str, np.ndarray]) -> None:
    arrow = pytest.importorskip("pyarrow", reason="pyarrow is not installed (pip install 'firmloop[parquet]')")
    parquet = pytest.importorskip("pyarrow.parquet")
    parquet.write_table(arrow.table(columns), path)


WRITERS = {
    "r.npz": lambda path, columns: np.savez(path, **columns),
    "r.mat": lambda path, columns: scipy.io.savemat(path, {**columns, "rate_Hz": 1000.0, "note": "bench 3"}),
    "row.mat": lambda path, columns: scipy.io.savemat(path, columns, oned_as="column"),
    "r73.mat": lambda path, columns: path.write_bytes(mat73(**{n: c[None, :] for n, c in columns.items()})),
    "r.parquet": write_parquet,
}


@pytest.mark.parametrize("name", WRITERS)
def test_every_format_gives_the_same_recording(tmp_path: Path, name: str) -> None:
    columns = columns_of(200)
    WRITERS[name](tmp_path / name, columns)
    recording = read_recording(tmp_path / name, {})
    np.testing.assert_array_equal(recording.time, columns["time_s"])
    assert set(recording.columns) == {"voltage_V", "current_A"}
    for signal in ("voltage_V", "current_A"):
        np.testing.assert_array_equal(recording.columns[signal], columns[signal])


@pytest.mark.parametrize("name", ["r.csv", "r.csv.gz"])
def test_csv_round_trip_keeps_every_bit(tmp_path: Path, name: str) -> None:
    columns = columns_of(500)
    first = make_recording(columns.pop("time_s"), columns, "bench", "")
    write_recording(first, tmp_path / name)
    second = read_recording(tmp_path / name, {})
    np.testing.assert_array_equal(second.time, first.time)
    for signal in columns:
        np.testing.assert_array_equal(second.columns[signal], first.columns[signal])
    assert [path.name for path in tmp_path.iterdir()] == [name]


def test_failed_write_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    recording = make_recording(np.arange(3.0), {"voltage_V": np.zeros(3)}, "bench", "")
    (tmp_path / "r.csv").write_text("old")

    def full(*_: object) -> None:
        raise OSError("disk full")

    monkeypatch.setattr("os.replace", full)
    with pytest.raises(OSError, match="disk full"):
        write_recording(recording, tmp_path / "r.csv")
    assert [path.name for path in tmp_path.iterdir()] == ["r.csv"]
    assert (tmp_path / "r.csv").read_text() == "old"


def test_rename_maps_foreign_names(tmp_path: Path) -> None:
    (tmp_path / "r.csv").write_text(GOOD.replace("time_s", "t").replace("speed_rad_s", "w"))
    rename = {"t": Column("time_s"), "w": Column("speed_rad_s"), "absent": Column("current_A")}
    recording = read_recording(tmp_path / "r.csv", rename)
    assert tuple(recording.columns) == ("voltage_V", "speed_rad_s")


def test_recordings_cannot_be_changed(tmp_path: Path) -> None:
    (tmp_path / "r.csv").write_text(GOOD)
    recording = read_recording(tmp_path / "r.csv", {})
    with pytest.raises(ValueError, match="read-only"):
        recording.time[0] = 1.0


def test_a_large_csv_is_read_in_a_few_times_what_numpy_takes(tmp_path: Path) -> None:
    rows = 24_841
    values = np.column_stack([np.arange(rows) * 1e-3, np.random.default_rng(0).normal(size=(rows, 4))])
    path = tmp_path / "r.csv"
    np.savetxt(path, values, delimiter=",", header="time_s,a_V,b_V,c_V,d_V", comments="")
    cpu = [time.process_time()]
    for read in (lambda: read_recording(path, {}).time, lambda: np.loadtxt(path, delimiter=",", skiprows=1)):
        assert len(read()) == rows
        cpu.append(time.process_time())
    assert cpu[1] - cpu[0] < 8.0 * (cpu[2] - cpu[1])


def test_parquet_without_pyarrow_says_how_to_get_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import sys

    monkeypatch.setitem(sys.modules, "pyarrow", None)
    monkeypatch.setitem(sys.modules, "pyarrow.parquet", None)
    (tmp_path / "r.parquet").write_bytes(b"PAR1")
    with pytest.raises(ToolError, match="pip install"):
        read_recording(tmp_path / "r.parquet", {})

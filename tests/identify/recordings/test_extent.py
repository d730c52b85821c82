"""Small files that claim, or unpack to, any size, and files without an end: refused before memory is taken."""

from __future__ import annotations

import gzip
import io
import os
import struct
import time
import zipfile
import zlib
from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.io

from firmloop.identify.error import IdentifyError
from firmloop.identify.recordings import extent
from firmloop.identify.recordings.recording import read_recording

CELL = b"0.25,1\n"


def npz_of(header: str, body: bytes = b"") -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        text = header.encode().ljust(117) + b"\n"
        archive.writestr("time_s.npy", b"\x93NUMPY\1\0" + struct.pack("<H", len(text)) + text + body)
    return buffer.getvalue()


def header(rows: object) -> str:
    return f"{{'descr': '<f8', 'fortran_order': False, 'shape': ({rows},), }}"


def mat_of(unpacked: bytes) -> bytes:
    buffer = io.BytesIO()
    scipy.io.savemat(buffer, {"time_s": np.zeros(3)})
    packed = zlib.compress(unpacked)
    return buffer.getvalue()[:128] + struct.pack("<II", 15, len(packed)) + packed


def claiming_mat73() -> bytes:
    buffer = io.BytesIO()
    with h5py.File(buffer, "w", userblock_size=512) as file:
        file.create_dataset("time_s", (10**12,), "f8", chunks=(1000,))
    return buffer.getvalue()


def crowded_h5() -> bytes:
    buffer = io.BytesIO()
    with h5py.File(buffer, "w") as file:
        for k in range(extent.MOST_COLUMNS + 1):
            file[f"c{k}"] = k
    return buffer.getvalue()


BOMBS = {
    "gzip": ("r.csv.gz", lambda: gzip.compress(CELL * (extent.MOST_BYTES // 7), 1), "unpacks to"),
    "gzip of many members": ("r.csv.gz", lambda: gzip.compress(CELL * 150_000) * 300, "unpacks to"),
    "gzip of many empty members": ("r.csv.gz", lambda: gzip.compress(b"") * 500_000, "is empty"),
    "HDF5 of many columns": ("r.h5", crowded_h5, "holds 2,001 entries"),
    "npz claims": ("r.npz", lambda: npz_of(header(10**12)), "claims 8,000,000,000,000 bytes"),
    "npz claims beyond 64 bits": ("r.npz", lambda: npz_of(header(10**30)), "claims"),
    "npz packed": ("r.npz", lambda: npz_of(header(34_000_000), bytes(8 * 34_000_000)), "holds"),
    "mat packed": ("r.mat", lambda: mat_of(bytes(extent.MOST_BYTES)), "unpacks to"),
    "mat claims": ("r.mat", lambda: mat_of(struct.pack("<II", 14, 2**31)), "MATLAB"),
    "mat 7.3 claims": ("r.mat", claiming_mat73, "holds 8,000,000,000,000 bytes"),
    "columns": ("r.csv", lambda: b",".join(b"c%d" % k for k in range(10**6)) + b"\n", "line 1: has"),
    "narrow columns": (
        "r.csv",
        lambda: b",".join(b"%d" % k for k in range(3000)) + b"\n" + b"0," * 2999 + b"0",
        "3,000",
    ),
    "text": ("r.csv", lambda: CELL * (extent.MOST_TEXT // 6), "bytes of text"),
    "no end of line": ("r.csv", lambda: b"1" * 50_000_000, "line 1: has"),
}


@pytest.mark.parametrize("bomb", BOMBS)
def test_a_bomb_is_refused_at_once(bomb: str, tmp_path: Path) -> None:
    name, make, words = BOMBS[bomb]
    (tmp_path / name).write_bytes(make())
    begin = time.monotonic()
    with pytest.raises(IdentifyError, match=words):
        read_recording(tmp_path / name, {})
    assert time.monotonic() - begin < 10.0


@pytest.mark.parametrize("way", ["external link", "external numbers", "virtual", "nowhere"])
def test_an_hdf5_file_that_reads_another_file_is_refused(way: str, tmp_path: Path) -> None:
    with h5py.File(tmp_path / "r.h5", "w") as file:
        file["voltage_V"] = file["temperature_C"] = np.arange(4.0)
        if way == "external link":
            file["time_s"] = h5py.ExternalLink("/etc/passwd", "/time_s")
        elif way == "external numbers":
            file.create_dataset("time_s", (4,), "f8", external=[("/etc/passwd", 0, 32)])
        elif way == "virtual":
            layout = h5py.VirtualLayout((4,), "f8")
            layout[:] = h5py.VirtualSource("/etc/passwd", "time_s", (4,))
            file.create_virtual_dataset("time_s", layout)
        else:
            file["time_s"] = h5py.SoftLink("/nowhere")
    with pytest.raises(IdentifyError, match="time_s of it stands in another file, or nowhere"):
        read_recording(tmp_path / "r.h5", {})


def test_groups_that_link_to_one_another_are_read_once(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "r.h5", "w") as file:
        file["time_s"] = file["voltage_V"] = np.arange(4.0)
        groups = [file.create_group(f"g{k}") for k in range(20)]
        for one in groups:
            for k, other in enumerate(groups):
                one[f"to{k}"] = other
    assert len(read_recording(tmp_path / "r.h5", {}).time) == 4


@pytest.mark.parametrize("unit", ["Y", "M", "W", "D"])
def test_dates_of_any_length_are_seconds(unit: str, tmp_path: Path) -> None:
    np.savez(tmp_path / "r.npz", time_s=np.arange(5).astype(f"M8[{unit}]"), voltage_V=np.arange(5.0))
    assert read_recording(tmp_path / "r.npz", {}).time[1] >= 86400.0


@pytest.mark.parametrize("name", ["pipe.csv", "pipe.npz"])
def test_a_pipe_is_not_waited_for(name: str, tmp_path: Path) -> None:
    os.mkfifo(tmp_path / name)
    with pytest.raises(IdentifyError, match="a pipe or a device, which may never end"):
        read_recording(tmp_path / name, {})


def test_devices_folders_and_circles_are_refused(tmp_path: Path) -> None:
    (tmp_path / "zero.csv").symlink_to("/dev/zero")
    (tmp_path / "folder.csv").mkdir()
    (tmp_path / "circle.csv").symlink_to(tmp_path / "circle.csv")
    for name, words in (
        ("zero", "a device"),
        ("folder", "is a folder"),
        ("circle", "cannot be read"),
        ("n" * 300, "too long"),
    ):
        with pytest.raises(IdentifyError, match=words):
            read_recording(tmp_path / f"{name}.csv", {})


def test_members_and_padding_are_gzip(tmp_path: Path) -> None:
    packed = gzip.compress(b"time_s,voltage_V\n0,1\n") + gzip.compress(b"1,2\n2,3\n") + bytes(512)
    (tmp_path / "r.csv.gz").write_bytes(packed)
    assert read_recording(tmp_path / "r.csv.gz", {}).time.tolist() == [0.0, 1.0, 2.0]
